#include "sim/peers/gige/drivers.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "drivers/aravis/aravis_camera.h"
#include "sim/peers/gige/camera_server.h"
#include "sim/rig/fault_plan.h"
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
  options.packing = peer.OneOf("packing", {"", "p", "Packed"}, "");
  if (options.bits == 16 && !options.packing.empty()) {
    peer.ErrorAt("packing", "16 bits are not packed: needs bits = 10 or 12");
  }
  options.exposure_events = peer.Bool("exposure_events", false);
  options.chunk_data = peer.Bool("chunk_data", false);
  return options;
}

struct Served {
  std::unique_ptr<GigeCameraServer> server;  // none while it restarts
  std::unique_ptr<FaultPlan> faults;         // first to go
};

// `server` outlives what it is for.
std::vector<FaultKind> FaultsOf(std::unique_ptr<GigeCameraServer>& server,
                                const GigeCameraOptions& options,
                                const std::shared_ptr<World>& world) {
  const auto loses = [&server](const char* name, double ratio) {
    return FaultKind{name, std::chrono::seconds(1), [&server, ratio](bool on) {
                       if (server != nullptr) server->LosePackets(on ? ratio : 0);
                     }};
  };
  return {loses("loses 0.1 % of the packets", 0.001),
          loses("loses 1 % of the packets", 0.01),
          loses("loses 5 % of the packets", 0.05),
          {"drops its client", std::chrono::milliseconds(1500),
           [&server](bool on) {
             if (server != nullptr) server->DropControl(on);
           }},
          {"restarts", std::chrono::milliseconds(500), [&server, options, world](bool begins) {
             server.reset();
             if (begins) return;
             auto started = GigeCameraServer::Start(options, world);
             if (!started.ok()) return spdlog::error("{}", MessageOf(started.status()));
             server = *std::move(started);
           }}};
}

}  // namespace

void RegisterGigePeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.cameras["sim-gige"].parse =
      [simulation](const TomlTable& table) -> DeviceOpener<Camera> {
    GigeCameraOptions options = ParsePeer(table);
    AravisOptions driver = ParseAravisOptions(table);
    if (!table.Has("lost_after_ms")) driver.lost_after = GigeCameraServer::kLongestSilence;
    return [simulation, options, plan = ParseFaultPlan(table.Table("peer")), driver](
               const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Camera>> {
      ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                       simulation->OpenWorld(*context.geometry, *context.clock));
      if (absl::Status fits = world->CheckFilm({options.width, options.height}); !fits.ok()) {
        return Annotate(fits, context.name);
      }
      auto served = std::make_shared<Served>();
      ASSIGN_OR_RETURN(served->server, GigeCameraServer::Start(options, world));
      ASSIGN_OR_RETURN(std::unique_ptr<Camera> camera, AravisCamera::Open(driver, context));
      served->faults =
          std::make_unique<FaultPlan>(context.name, plan, FaultsOf(served->server, options, world));
      return std::make_unique<ServedCamera>(std::move(served), std::move(camera), "sim-gige");
    };
  };
}

}  // namespace lightstage::sim
