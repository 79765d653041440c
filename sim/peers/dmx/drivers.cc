#include "sim/peers/dmx/drivers.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "base/status.h"
#include "drivers/dmx/dmx_lamps.h"
#include "drivers/dmx/libusb_bus.h"
#include "drivers/dmx/options.h"
#include "drivers/link/device_thread.h"
#include "sim/peers/dmx/dmx_pro.h"
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

std::vector<FaultKind> WidgetFaults(const std::shared_ptr<SimUsbDevice>& widget, bool open) {
  const auto fails = [widget](const char* name, UsbFault fault) {
    return FaultKind{name, milliseconds(500),
                     [widget, fault](bool on) { widget->Fail(on ? fault : UsbFault::kNone); }};
  };
  std::vector<FaultKind> faults = {
      fails("takes no byte", UsbFault::kStall),
      fails("takes half of the bytes", UsbFault::kShortWrite),
      fails("does nothing", UsbFault::kSilent),
      {"unplugged", milliseconds(500),
       [widget](bool on) { on ? widget->Unplug() : widget->Plug(); }},
      {"unplugged in the middle of a frame", milliseconds(500), [widget](bool on) {
         widget->Fail(on ? UsbFault::kUnplugMidFrame : UsbFault::kNone);
         if (!on) widget->Plug();
       }}};
  // Of a Pro nobody asks for that.
  if (open) faults.push_back(fails("says that it still has bytes", UsbFault::kNeverEmpty));
  return faults;
}

std::shared_ptr<SimUsbDevice> MakeWidget(const dmx::DmxOptions& options, Clock& clock,
                                         const DmxFixtureOptions& fixtures,
                                         std::shared_ptr<World> world) {
  const std::string& serial = options.device.serial;
  if (options.widget == dmx::WidgetKind::kOpen) {
    return std::make_shared<OpenDmx>(
        dmx::UsbIdentity{.product = "FT232R USB UART", .serial = serial}, clock, fixtures,
        std::move(world));
  }
  return std::make_shared<DmxPro>(dmx::UsbIdentity{.product = "DMX USB PRO", .serial = serial},
                                  clock, DmxProOptions(), fixtures, std::move(world));
}

DeviceOpener<Lamps> ParseLamps(const std::shared_ptr<Simulation>& simulation,
                               const TomlTable& table) {
  const dmx::DmxOptions options = dmx::ParseDmxOptions(table);
  if (options.device.serial.empty()) {
    table.ErrorAt("serial", "missing; the simulated widget gets it");
  }
  DmxFixtureOptions fixtures;
  fixtures.first_channels = options.channels.first;
  fixtures.fine = options.channels.bits == 16;
  fixtures.slots = options.channels.slots;
  const TomlTable peer = table.Table("peer");
  const bool kernel = ParseWireIsKernel(peer), open = options.widget == dmx::WidgetKind::kOpen;
  if (kernel && !open && table.Has("widget")) {
    peer.ErrorAt("wire", "must be \"process\" where a simulated widget is a \"pro\"");
  }
  return [simulation, options, fixtures, kernel, open, plan = ParseFaultPlan(peer)](
             const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Lamps>> {
    RETURN_IF_ERROR(DeviceThread::CheckClock(context));
    RETURN_IF_ERROR(CheckLampCount(context, static_cast<int>(fixtures.first_channels.size())));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    const std::shared_ptr<SimUsbDevice> widget =
        MakeWidget(options, *context.clock, fixtures, std::move(world));
    auto served = std::make_shared<Served>();
    if (kernel) {
      ASSIGN_OR_RETURN(served->gadget, FtdiGadget::Plug(widget));
    }
    ASSIGN_OR_RETURN(std::unique_ptr<Lamps> device,
                     dmx::OpenDmxLamps(options, context,
                                       kernel ? dmx::MakeLibusbBus() : MakeSimUsbBus({widget})));
    served->faults = std::make_unique<FaultPlan>(
        context.name, plan, kernel ? GadgetFaults(*served->gadget) : WidgetFaults(widget, open));
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
