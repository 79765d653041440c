#include "sim/rig/sim_axis.h"

#include <algorithm>

#include "absl/strings/str_format.h"

namespace lightstage::sim {
namespace {

// Times beyond would overflow.
constexpr Duration kLongestTurn = std::chrono::hours(10000);

AxisInfo InfoOf(const std::string& name, const SimAxisOptions& options) {
  AxisInfo info;
  info.identity = {.name = name, .driver = "sim", .model = "lightstaged simulated axis"};
  info.min = options.min;
  info.max = options.max;
  info.continuous = options.continuous;
  info.max_velocity_dps = options.max_velocity_dps;
  info.max_acceleration_dps2 = options.mechanics.max_acceleration_dps2;
  info.settle = options.mechanics.settle;
  info.tolerance = Degrees(0.001);
  return info;
}

}  // namespace

SimAxis::SimAxis(const std::string& name, const SimAxisOptions& options,
                 std::shared_ptr<World> world)
    : options_(options),
      info_(InfoOf(name, options)),
      world_(std::move(world)),
      timers_(world_->clock()),
      operations_(timers_) {}

SimAxis::~SimAxis() {
  BrakeNow();
  timers_.Close();
  operations_.Close(info_.identity.name);
}

AxisState SimAxis::State() const {
  AxisState state = world_->AxisAt(options_.role, timers_.clock().Now());
  state.homed = homed_;
  return state;
}

absl::Status SimAxis::CheckHomed() const {
  if (homed_) return absl::OkStatus();
  return Error(absl::StatusCode::kFailedPrecondition, "NOT_HOMED",
               absl::StrCat(info_.identity.name, " must be homed first"),
               {{"axis", info_.identity.name}});
}

absl::StatusOr<AxisState> SimAxis::AtRest() const {
  AxisState state = State();
  if (!state.moving) return state;
  // After a deadline that was too short.
  return Error(absl::StatusCode::kFailedPrecondition, "AXIS_BUSY",
               absl::StrCat(info_.identity.name, " is still moving; wait for it or stop it"),
               {{"axis", info_.identity.name}});
}

absl::StatusOr<TimePoint> SimAxis::Go(Angle target, double velocity_dps, bool stall) {
  const TimePoint now = timers_.clock().Now();
  ASSIGN_OR_RETURN(const AxisState state, AtRest());
  const double from = state.position.degrees();
  const double distance = MoveDistance(info_, state.position, target).degrees();
  if (distance == 0) return stall ? kNever : now;
  const double velocity =
      velocity_dps > 0 ? std::min(velocity_dps, info_.max_velocity_dps) : info_.max_velocity_dps;
  // A stall: something is in its way half-way; it comes to rest there and never reports.
  const Motion motion =
      stall ? Travel(now, from, distance / 2, from + distance / 2, velocity, options_.mechanics)
            : Travel(now, from, distance, target.degrees(), velocity, options_.mechanics);
  world_->SetMotion(options_.role, motion);
  return stall ? kNever : motion.back().start;
}

void SimAxis::Home(TimePoint deadline, Completion<AxisState> done) {
  const Angle reference = info_.continuous ? Degrees(0) : info_.min;
  operations_.Start(
      "AXIS_BUSY", info_.identity.name + ": homing", deadline, std::move(done),
      [&] { return Go(reference, 0, false); },
      [this]() -> absl::StatusOr<AxisState> {
        homed_ = true;
        return State();
      });
}

void SimAxis::Move(Angle target, double velocity_dps, TimePoint deadline,
                   Completion<AxisState> done) {
  if (absl::Status homed = CheckHomed(); !homed.ok()) return std::move(done)(homed);
  if (absl::Status inside = CheckTarget(info_, target); !inside.ok()) {
    return std::move(done)(inside);
  }
  operations_.Start(
      "AXIS_BUSY", absl::StrFormat("%s: move to %g deg", info_.identity.name, target.degrees()),
      deadline, std::move(done),
      [&] { return Go(target, velocity_dps, world_->FaultDue(Operation::kMove)); },
      [this]() -> absl::StatusOr<AxisState> { return State(); });
}

void SimAxis::Turn(double velocity_dps, TimePoint deadline, Completion<AxisState> done) {
  if (absl::Status homed = CheckHomed(); !homed.ok()) return std::move(done)(homed);
  if (absl::Status good = CheckTurn(info_, velocity_dps); !good.ok()) {
    return std::move(done)(good);
  }
  operations_.Start(
      "AXIS_BUSY", absl::StrFormat("%s: turning at %g deg/s", info_.identity.name, velocity_dps),
      deadline, std::move(done),
      [&]() -> absl::StatusOr<TimePoint> {
        const TimePoint now = timers_.clock().Now();
        ASSIGN_OR_RETURN(const AxisState state, AtRest());
        world_->SetMotion(options_.role,
                          ::lightstage::sim::Turn(now, state.position.degrees(), velocity_dps,
                                                  std::clamp(deadline, now, now + kLongestTurn),
                                                  options_.mechanics));
        return kNever;
      },
      [this]() -> absl::StatusOr<AxisState> { return State(); });
}

void SimAxis::Read(TimePoint, Completion<AxisState> done) { std::move(done)(State()); }

TimePoint SimAxis::BrakeNow() {
  const TimePoint now = timers_.clock().Now();
  const AxisState state = world_->AxisAt(options_.role, now);
  if (!state.moving) return now;
  const Motion motion =
      Brake(now, state.position.degrees(), state.velocity_dps, options_.mechanics);
  world_->SetMotion(options_.role, motion);
  return motion.back().start;
}

void SimAxis::Stop(TimePoint deadline, Completion<AxisState> done) {
  operations_.Interrupt(
      Error(absl::StatusCode::kCancelled, "STOPPED",
            absl::StrCat(info_.identity.name, " was stopped"), {{"axis", info_.identity.name}}),
      info_.identity.name + ": stop", deadline, std::move(done), [this] { return BrakeNow(); },
      [this]() -> absl::StatusOr<AxisState> { return State(); });
}

}  // namespace lightstage::sim
