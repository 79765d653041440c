#include "sim/rig/sim_lamps.h"

#include <cmath>

#include "absl/strings/str_format.h"

namespace lightstage::sim {
namespace {

LampsInfo InfoOf(const std::string& name, const SimLampsOptions& options, const World& world) {
  LampsInfo info;
  info.identity = {.name = name, .driver = "sim", .model = "lightstaged simulated lamps"};
  info.count = static_cast<int>(world.geometry().brace.lamps.size());
  info.steps = options.steps;
  info.settle = options.settle;
  info.max_time_to_dark = options.max_time_to_dark;
  return info;
}

}  // namespace

SimLamps::SimLamps(const std::string& name, const SimLampsOptions& options,
                   std::shared_ptr<World> world)
    : info_(InfoOf(name, options, *world)),
      rise_(options.rise),
      fall_(options.fall),
      world_(std::move(world)),
      timers_(world_->clock()),
      operations_(timers_) {}

SimLamps::~SimLamps() {
  timers_.Close();
  const TimePoint now = timers_.clock().Now();
  world_->RampLamps(now, {}, {},
                    std::vector<float>(info_.count));  // the power goes with the device
  operations_.Close(info_.identity.name);
}

void SimLamps::Set(const std::vector<float>& levels, TimePoint deadline,
                   Completion<LampsState> done) {
  if (absl::Status good = CheckLevels(info_, levels); !good.ok()) return std::move(done)(good);
  LampsState state{levels};
  if (info_.steps > 0) {
    const auto steps = static_cast<float>(info_.steps);
    for (float& level : state.levels) level = std::round(level * steps) / steps;
  }
  operations_.Start(
      "LAMPS_BUSY", info_.identity.name + ": levels", deadline, std::move(done),
      [&]() -> absl::StatusOr<TimePoint> {
        const TimePoint now = timers_.clock().Now(), settled = now + info_.settle;
        world_->RampLamps(now, rise_, fall_, state.levels);
        MutexLock lock(&mutex_);
        Restart();
        return world_->FaultDue(Operation::kSet) ? kNever : settled;
      },
      [state]() -> absl::StatusOr<LampsState> { return state; });
}

void SimLamps::Dark(TimePoint deadline, Completion<LampsState> done) {
  const LampsState dark{std::vector<float>(info_.count)};
  operations_.Interrupt(
      Error(absl::StatusCode::kCancelled, "DARKENED",
            absl::StrCat(info_.identity.name, " was told to go dark"),
            {{"device", info_.identity.name}}),
      info_.identity.name + ": dark", deadline, std::move(done),
      [&] {
        const TimePoint now = timers_.clock().Now();
        world_->RampLamps(now, rise_, fall_, dark.levels);
        return now + info_.settle;
      },
      [dark]() -> absl::StatusOr<LampsState> { return dark; });
}

absl::Status SimLamps::SetTimeToDark(Duration time) {
  if (time < Duration::zero() || time > info_.max_time_to_dark) {
    return Error(
        absl::StatusCode::kOutOfRange, "TIME_TO_DARK",
        absl::StrFormat("%s: a time to dark of %g s is outside [0, %g] s", info_.identity.name,
                        Seconds(time), Seconds(info_.max_time_to_dark)),
        {{"device", info_.identity.name},
         {"time_s", absl::StrCat(Seconds(time))},
         {"max_s", absl::StrCat(Seconds(info_.max_time_to_dark))}});
  }
  MutexLock lock(&mutex_);
  time_to_dark_ = time;
  Restart();
  return absl::OkStatus();
}

absl::Status SimLamps::Refresh() {
  MutexLock lock(&mutex_);
  Restart();
  return absl::OkStatus();
}

// Refreshing is frequent, timers are not cheap: the one that runs looks again when it is due.
void SimLamps::Restart() {
  dark_at_ = time_to_dark_ == Duration::zero() ? kNever : timers_.clock().Now() + time_to_dark_;
  if (timer_set_ || dark_at_ == kNever) return;
  timer_set_ = true;
  timers_.At(dark_at_, [this] { TimeIsUp(); });
}

void SimLamps::TimeIsUp() {
  const TimePoint now = timers_.clock().Now();
  MutexLock lock(&mutex_);
  timer_set_ = false;
  if (dark_at_ == kNever) return;
  if (now < dark_at_) {
    timer_set_ = true;
    timers_.At(dark_at_, [this] { TimeIsUp(); });
    return;
  }
  dark_at_ = kNever;
  world_->RampLamps(now, rise_, fall_, std::vector<float>(info_.count));
}

}  // namespace lightstage::sim
