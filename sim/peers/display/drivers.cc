#include "sim/peers/display/drivers.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "base/status.h"
#include "drivers/display/driver.h"
#include "sim/peers/display/projector.h"
#include "sim/rig/fault_plan.h"
#include "sim/rig/served.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr char kName[] = "sim-display";

struct Served {
  std::unique_ptr<DisplayProjector> projector;
  std::unique_ptr<FaultPlan> faults;  // first to go
};

// What is confirmed has been scanned out, as by a projector that keeps its time.
class ServedDisplay final : public ServedProjector {
 public:
  ServedDisplay(const std::shared_ptr<Served>& served, std::unique_ptr<Projector> device)
      : ServedProjector(served, std::move(device), kName), projector_(*served->projector) {}
  void Show(const Pattern& pattern, TimePoint deadline, Completion<ProjectorState> done) override {
    device().Show(pattern, deadline, AfterScan(std::move(done)));
  }
  void Black(TimePoint deadline, Completion<ProjectorState> done) override {
    device().Black(deadline, AfterScan(std::move(done)));
  }

 private:
  Completion<ProjectorState> AfterScan(Completion<ProjectorState> done) {
    return [&projector = projector_,
            done = std::move(done)](absl::StatusOr<ProjectorState> state) mutable {
      projector.ScanOut();
      std::move(done)(std::move(state));
    };
  }

  DisplayProjector& projector_;
};

std::vector<FaultKind> DisplayFaults(DisplayProjector& projector) {
  const auto said = [](const absl::Status& status) {
    if (!status.ok()) spdlog::error("the simulated projector's {}", MessageOf(status));
  };
  return {{"X server ends", milliseconds(500), [&projector](bool on) { projector.EndServer(on); }},
          {"X server silent", milliseconds(1500),
           [&projector](bool on) { projector.SuspendServer(on); }},
          {"output switched off", milliseconds(500),
           [&projector, said](bool on) { said(projector.SwitchOff(on)); }},
          {"mode changed", milliseconds(500),
           [&projector, said](bool on) { said(projector.ChangeMode(on)); }}};
}

}  // namespace

VideoOutput ParseServedDisplay(const TomlTable& table) {
  const std::string x_display = table.String("x_display");
  const bool numbered = x_display.size() > 1 && x_display.size() <= 6 && x_display[0] == ':' &&
                        x_display.find_first_not_of("0123456789", 1) == std::string::npos;
  if (!x_display.empty() && !numbered) {
    table.ErrorAt("x_display",
                  "must be \":\" and a number up to 65535: the simulated projector serves it");
  }
  return [x_display, plan = ParseFaultPlan(table.Table("peer")),
          connect = DisplayDriver().parse(table)](
             const DeviceContext& context,
             VideoSink sink) mutable -> absl::StatusOr<std::unique_ptr<Projector>> {
    const ProjectorGeometry& mode = context.geometry->projector;
    auto served = std::make_shared<Served>();
    ASSIGN_OR_RETURN(served->projector,
                     DisplayProjector::Start(x_display, mode.width, mode.height, std::move(sink)));
    ASSIGN_OR_RETURN(std::unique_ptr<Projector> device, connect(context));
    served->faults =
        std::make_unique<FaultPlan>(context.name, plan, DisplayFaults(*served->projector));
    return std::make_unique<ServedDisplay>(served, std::move(device));
  };
}

void RegisterDisplayPeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.projectors[kName].parse = [simulation](const TomlTable& table) {
    return [simulation, open = ParseServedDisplay(table)](
               const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Projector>> {
      RETURN_IF_ERROR(CheckProjector(context));
      ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                       simulation->OpenWorld(*context.geometry, *context.clock));
      return open(context, LightOf(std::move(world)));
    };
  };
}

}  // namespace lightstage::sim
