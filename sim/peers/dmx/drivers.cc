#include "sim/peers/dmx/drivers.h"

#include <utility>

#include "base/status.h"
#include "drivers/dmx/driver.h"
#include "drivers/dmx/options.h"
#include "drivers/link/device_thread.h"
#include "sim/peers/dmx/ftdi_gadget.h"
#include "sim/peers/dmx/open_dmx.h"
#include "sim/rig/served.h"

namespace lightstage::sim {
namespace {

constexpr char kName[] = "sim-dmx";

DeviceOpener<Lamps> ParseLamps(const std::shared_ptr<Simulation>& simulation,
                               const TomlTable& table) {
  const dmx::DmxOptions options = dmx::ParseDmxOptions(table);
  if (options.widget != dmx::WidgetKind::kOpen) {
    table.ErrorAt("widget", "must be \"open\" where the widget is simulated");
  }
  if (options.device.serial.empty()) {
    table.ErrorAt("serial", "missing; the simulated widget gets it");
  }
  DmxFixtureOptions fixtures;
  fixtures.first_channels = options.channels.first;
  fixtures.fine = options.channels.bits == 16;
  fixtures.slots = options.channels.slots;
  return [simulation, fixtures, serial = options.device.serial, connect = DmxDriver().parse(table)](
             const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Lamps>> {
    RETURN_IF_ERROR(DeviceThread::CheckClock(context));
    RETURN_IF_ERROR(CheckLampCount(context, static_cast<int>(fixtures.first_channels.size())));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    const dmx::UsbIdentity identity{.product = "FT232R USB UART", .serial = serial};
    ASSIGN_OR_RETURN(std::shared_ptr<FtdiGadget> peer,
                     FtdiGadget::Plug(std::make_shared<OpenDmx>(identity, *context.clock, fixtures,
                                                                std::move(world))));
    ASSIGN_OR_RETURN(std::unique_ptr<Lamps> device, connect(context));
    return std::make_unique<ServedLamps>(std::move(peer), std::move(device), kName);
  };
}

}  // namespace

void RegisterDmxPeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.lamps[kName].parse = [simulation](const TomlTable& table) {
    return ParseLamps(simulation, table);
  };
}

}  // namespace lightstage::sim
