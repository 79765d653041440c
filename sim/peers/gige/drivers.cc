#include "sim/peers/gige/drivers.h"

#include <utility>

#include "drivers/aravis/driver.h"
#include "sim/peers/gige/camera_server.h"
#include "sim/rig/served.h"

namespace lightstage::sim {
namespace {

GigeCameraOptions ParsePeer(const TomlTable& table) {
  GigeCameraOptions options;
  options.address = table.String("address");
  options.serial = table.String("serial", options.serial);
  TomlTable peer = table.Table("peer");
  options.width = static_cast<int>(peer.Int("sensor_width", 2, 16384, 640));
  options.height = static_cast<int>(peer.Int("sensor_height", 2, 16384, 480));
  if (options.width % 2 != 0) peer.ErrorAt("sensor_width", "must be even");
  if (options.height % 2 != 0) peer.ErrorAt("sensor_height", "must be even");
  options.bits = static_cast<int>(peer.Int("bits", 10, 16, options.bits));
  if (options.bits != 10 && options.bits != 12 && options.bits != 16) {
    peer.ErrorAt("bits", "must be 10, 12 or 16");
  }
  return options;
}

}  // namespace

void RegisterGigePeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.cameras["sim-gige"].parse =
      [simulation](const TomlTable& table) -> DeviceOpener<Camera> {
    GigeCameraOptions options = ParsePeer(table);
    return [simulation, options, connect = AravisDriver().parse(table)](
               const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Camera>> {
      ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                       simulation->OpenWorld(*context.geometry, *context.clock));
      if (absl::Status fits = world->CheckFilm({options.width, options.height}); !fits.ok()) {
        return Annotate(fits, context.name);
      }
      ASSIGN_OR_RETURN(std::unique_ptr<GigeCameraServer> server,
                       GigeCameraServer::Start(options, std::move(world)));
      ASSIGN_OR_RETURN(std::unique_ptr<Camera> camera, connect(context));
      return std::make_unique<ServedCamera>(std::move(server), std::move(camera), "sim-gige");
    };
  };
}

}  // namespace lightstage::sim
