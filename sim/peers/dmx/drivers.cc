#include "sim/peers/dmx/drivers.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "base/status.h"
#include "drivers/dmx/dmx_lamps.h"
#include "drivers/dmx/libusb_bus.h"
#include "drivers/dmx/options.h"
#include "drivers/link/device_thread.h"
#include "sim/peers/dmx/ftdi_gadget.h"
#include "sim/peers/dmx/open_dmx.h"
#include "sim/rig/fault_plan.h"
#include "sim/rig/served.h"
#include "sim/rig/wire.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr char kName[] = "sim-dmx";

struct Served {
  std::unique_ptr<FtdiGadget> gadget;  // on the kernel's wire
  std::unique_ptr<FaultPlan> faults;   // first to go
};

std::vector<FaultKind> GadgetFaults(FtdiGadget& gadget) {
  return {{"unplugged", milliseconds(500), [&gadget](bool on) {
             if (absl::Status attached = gadget.Attach(!on); !attached.ok()) {
               spdlog::error("{}", MessageOf(attached));
             }
           }}};
}

std::vector<FaultKind> ChipFaults(const std::shared_ptr<OpenDmx>& chip) {
  const auto fails = [chip](const char* name, UsbFault fault) {
    return FaultKind{name, milliseconds(500),
                     [chip, fault](bool on) { chip->Fail(on ? fault : UsbFault::kNone); }};
  };
  return {fails("takes no byte", UsbFault::kStall),
          fails("takes half of the bytes", UsbFault::kShortWrite),
          fails("does nothing", UsbFault::kSilent),
          fails("says that it still has bytes", UsbFault::kNeverEmpty),
          {"unplugged", milliseconds(500), [chip](bool on) { on ? chip->Unplug() : chip->Plug(); }},
          {"unplugged in the middle of a frame", milliseconds(500), [chip](bool on) {
             chip->Fail(on ? UsbFault::kUnplugMidFrame : UsbFault::kNone);
             if (!on) chip->Plug();
           }}};
}

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
  const TomlTable peer = table.Table("peer");
  return [simulation, options, fixtures, kernel = ParseWireIsKernel(peer),
          plan = ParseFaultPlan(peer)](
             const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Lamps>> {
    RETURN_IF_ERROR(DeviceThread::CheckClock(context));
    RETURN_IF_ERROR(CheckLampCount(context, static_cast<int>(fixtures.first_channels.size())));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    const dmx::UsbIdentity identity{.product = "FT232R USB UART", .serial = options.device.serial};
    auto chip = std::make_shared<OpenDmx>(identity, *context.clock, fixtures, std::move(world));
    auto served = std::make_shared<Served>();
    if (kernel) {
      ASSIGN_OR_RETURN(served->gadget, FtdiGadget::Plug(chip));
    }
    ASSIGN_OR_RETURN(
        std::unique_ptr<Lamps> device,
        dmx::OpenDmxLamps(options, context, kernel ? dmx::MakeLibusbBus() : MakeSimUsbBus({chip})));
    served->faults = std::make_unique<FaultPlan>(
        context.name, plan, kernel ? GadgetFaults(*served->gadget) : ChipFaults(chip));
    return std::make_unique<ServedLamps>(std::move(served), std::move(device), kName);
  };
}

}  // namespace

void RegisterDmxPeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.lamps[kName].parse = [simulation](const TomlTable& table) {
    return ParseLamps(simulation, table);
  };
}

}  // namespace lightstage::sim
