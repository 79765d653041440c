#include "sim/peers/dlpc350/drivers.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "base/status.h"
#include "drivers/dlpc350/link.h"
#include "drivers/dlpc350/options.h"
#include "sim/peers/dlpc350/in_process_port.h"
#include "sim/peers/dlpc350/uhid_device.h"
#include "sim/rig/fault_plan.h"
#include "sim/rig/served.h"
#include "sim/rig/wire.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr char kName[] = "sim-dlpc350";

// The controller and its wire.
struct Served {
  Served(std::shared_ptr<World> world, std::map<FlashPlace, Pattern> flash)
      : device(std::move(world), std::move(flash)) {}
  Dlpc350Device device;
  std::unique_ptr<UhidDevice> usb;    // on the kernel's wire; none while it is unplugged
  std::unique_ptr<FaultPlan> faults;  // first to go
};

std::vector<FaultKind> Faults(Served& served, const std::string& serial) {
  Dlpc350Device& device = served.device;
  const auto fault = [&device](const char* name, Dlpc350Device::Faults faults) {
    return FaultKind{name, milliseconds(500), [&device, faults](bool on) {
                       device.SetFaults(on ? faults : Dlpc350Device::Faults());
                     }};
  };
  return {fault("refuses to start and stop", {.nack = 0x1A24}),
          fault("takes no LED setting", {.ignored = 0x1A07}),
          fault("short reports", {.short_reports = true}),
          fault("mirrors parked", {.parked = true}),
          fault("sequencer stopped", {.sequencer_stopped = true}),
          fault("silent", {.silent = true}),
          fault("late answers", {.late = true}),
          Once("power cycle", [&device] { device.PowerCycle(false); }),
          {"unplugged", milliseconds(500),
           [&served, serial, kernel = served.usb != nullptr](bool begins) {
             if (!kernel) return served.device.Unplug(begins);
             served.usb.reset();
             if (begins) return;
             auto plugged = UhidDevice::Plug(served.device, serial);
             if (!plugged.ok()) return spdlog::error("{}", MessageOf(plugged.status()));
             served.usb = *std::move(plugged);
           }}};
}

// Without a signal it shows black.
VideoSink VideoInput(Dlpc350Device& device) {
  return [&device](const PixelCodes& codes) {
    device.SetVideoInput(codes != nullptr ? Projection(codes) : Projection());
  };
}

DeviceOpener<Projector> ParseProjector(const std::shared_ptr<Simulation>& simulation,
                                       const VideoOutputParser& parse_output,
                                       const TomlTable& table) {
  const dlpc350::Options options = dlpc350::ParseOptions(table);
  if (options.serial.empty()) {
    table.ErrorAt("serial", "missing; the simulated projector gets it");
  }
  std::map<FlashPlace, Pattern> flash;
  for (const auto& [pattern, place] : options.patterns) {
    if (place.invert) table.ErrorAt("patterns", "invert cannot be simulated");
    flash[{place.image, place.number, place.depth}] = pattern;
  }
  VideoOutput open_screen;
  if (table.Has("mode") && !options.flash) {
    open_screen = parse_output(table.Table("display", true));
  }
  const TomlTable peer = table.Table("peer");
  return [simulation, flash, options, open_screen = std::move(open_screen),
          kernel = ParseWireIsKernel(peer), plan = ParseFaultPlan(peer)](
             const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Projector>> {
    RETURN_IF_ERROR(CheckProjector(context));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    auto served = std::make_shared<Served>(std::move(world), flash);
    dlpc350::HidOpener open = InProcessHid(served->device, options.serial);
    if (kernel) {
      ASSIGN_OR_RETURN(served->usb, UhidDevice::Plug(served->device, options.serial));
      open = [serial = options.serial] { return dlpc350::OpenHidDevice("", serial); };
    }
    std::unique_ptr<Projector> screen;
    if (open_screen != nullptr) {
      ASSIGN_OR_RETURN(screen, open_screen(context, VideoInput(served->device)));
    }
    ASSIGN_OR_RETURN(
        std::unique_ptr<Projector> device,
        OpenLinkedProjector(
            context, kName,
            std::make_unique<dlpc350::Link>(context, options, std::move(open), std::move(screen))));
    served->faults =
        std::make_unique<FaultPlan>(context.name, plan, Faults(*served, options.serial));
    return std::make_unique<ServedProjector>(std::move(served), std::move(device), kName);
  };
}

}  // namespace

void RegisterDlpc350Peer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation,
                         const VideoOutputParser& output) {
  registry.projectors[kName].parse = [simulation, output](const TomlTable& table) {
    return ParseProjector(simulation, output, table);
  };
}

}  // namespace lightstage::sim
