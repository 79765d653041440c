#include "sim/peers/dlpc350/drivers.h"

#include <utility>

#include "base/status.h"
#include "drivers/dlpc350/driver.h"
#include "drivers/dlpc350/options.h"
#include "sim/peers/dlpc350/uhid_device.h"
#include "sim/rig/served.h"

namespace lightstage::sim {
namespace {

constexpr char kName[] = "sim-dlpc350";

// The controller and its wire.
struct PluggedProjector {
  PluggedProjector(std::shared_ptr<World> world, std::map<FlashPlace, Pattern> flash)
      : device(std::move(world), std::move(flash)) {}
  Dlpc350Device device;
  std::unique_ptr<UhidDevice> usb;
};

DeviceOpener<Projector> ParseProjector(const std::shared_ptr<Simulation>& simulation,
                                       const TomlTable& table) {
  const dlpc350::Options options = dlpc350::ParseOptions(table);
  if (table.Has("mode") && !options.flash) {
    table.ErrorAt("mode", "must be \"flash\" where the projector is simulated");
  }
  if (options.serial.empty()) {
    table.ErrorAt("serial", "missing; the simulated projector gets it");
  }
  std::map<FlashPlace, Pattern> flash;
  for (const auto& [pattern, place] : options.patterns) {
    if (place.invert) table.ErrorAt("patterns", "invert cannot be simulated");
    flash[{place.image, place.number, place.depth}] = pattern;
  }
  return [simulation, flash, serial = options.serial, connect = Dlpc350Driver().parse(table)](
             const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Projector>> {
    RETURN_IF_ERROR(CheckProjector(context));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    auto peer = std::make_shared<PluggedProjector>(std::move(world), flash);
    ASSIGN_OR_RETURN(peer->usb, UhidDevice::Plug(peer->device, serial));
    ASSIGN_OR_RETURN(std::unique_ptr<Projector> device, connect(context));
    return std::make_unique<ServedProjector>(std::move(peer), std::move(device), kName);
  };
}

}  // namespace

void RegisterDlpc350Peer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.projectors[kName].parse = [simulation](const TomlTable& table) {
    return ParseProjector(simulation, table);
  };
}

}  // namespace lightstage::sim
