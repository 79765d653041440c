#include "sim/rig/sim_projector.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace lightstage::sim {
namespace {

ProjectorInfo InfoOf(const std::string& name, Duration settle, const World& world) {
  ProjectorInfo info;
  info.identity = {.name = name, .driver = "sim", .model = "lightstaged simulated projector"};
  info.width = world.geometry().projector.width;
  info.height = world.geometry().projector.height;
  info.settle = settle;
  return info;
}

}  // namespace

SimProjector::SimProjector(const std::string& name, const SimProjectorOptions& options,
                           std::shared_ptr<World> world)
    : info_(InfoOf(name, options.settle, *world)),
      latency_(options.latency),
      world_(std::move(world)),
      timers_(world_->clock()),
      operations_(timers_) {
  const TimePoint now = timers_.clock().Now();
  world_->RampProjection(now, now, Pattern{});  // switched on, it shows black
}

SimProjector::~SimProjector() {
  timers_.Close();
  world_->EndProjector(timers_.clock().Now());
  operations_.Close(info_.identity.name);
}

TimePoint SimProjector::Change(const Pattern& pattern) {
  const TimePoint now = timers_.clock().Now(), settled = now + info_.settle;
  world_->RampProjection(now + latency_, std::max(now + latency_, settled), pattern);
  return settled;
}

void SimProjector::Show(const Pattern& pattern, TimePoint deadline,
                        Completion<ProjectorState> done) {
  if (absl::Status good = Validate(pattern); !good.ok()) return std::move(done)(good);
  operations_.Start(
      "PROJECTOR_BUSY", absl::StrCat(info_.identity.name, ": show ", PatternName(pattern)),
      deadline, std::move(done),
      [&]() -> absl::StatusOr<TimePoint> {
        const TimePoint settled = Change(pattern);
        return world_->FaultDue(Operation::kShow) ? kNever : settled;
      },
      [pattern]() -> absl::StatusOr<ProjectorState> { return ProjectorState{pattern}; });
}

void SimProjector::Black(TimePoint deadline, Completion<ProjectorState> done) {
  operations_.Interrupt(
      Error(absl::StatusCode::kCancelled, "DARKENED",
            absl::StrCat(info_.identity.name, " was told to show black"),
            {{"device", info_.identity.name}}),
      info_.identity.name + ": black", deadline, std::move(done), [&] { return Change(Pattern{}); },
      []() -> absl::StatusOr<ProjectorState> { return ProjectorState{}; });
}

}  // namespace lightstage::sim
