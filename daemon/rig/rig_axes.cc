// The rig's axes: homing, poses, moves by hand.
#include <cmath>

#include "absl/strings/str_format.h"
#include "daemon/rig/device_errors.h"
#include "daemon/rig/rig.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

constexpr AxisId kAxes[] = {AxisId::kTurntable, AxisId::kTilt};

// Homing speed is the drive's own business: this only bounds the wait.
constexpr Duration kHomingTimeout = std::chrono::seconds(120);

// Slowing down takes as long as speeding up did.
Duration BrakingTime(const AxisInfo& info) {
  return FromSeconds(info.max_velocity_dps / info.max_acceleration_dps2);
}

// Until the motion is done, at most until `end`; true if it was cancelled before. In slices, because a client's cancellation wakes nobody.
bool WaitUnless(Clock& clock, Pending<AxisState>& motion, TimePoint end,
                absl::FunctionRef<bool()> cancelled) {
  while (!motion.done() && clock.Now() < end) {
    if (cancelled()) return true;
    clock.WaitUntil(std::min(end, clock.Now() + std::chrono::milliseconds(50)),
                    [&] { return motion.done(); });
  }
  return false;
}

}  // namespace

void Rig::StoreAxis(AxisId id, const AxisState& state) {
  MutexLock lock(&state_mutex_);
  axis_state_[static_cast<int>(id)] = state;
}

// Until a move has confirmed, nobody knows where the axis is: one that failed must not count as "already there".
void Rig::MarkMoving(AxisId id) {
  MutexLock lock(&state_mutex_);
  axis_state_[static_cast<int>(id)].moving = true;
}

absl::Status Rig::WaitAxis(AxisId id, Pending<AxisState>& pending, TimePoint deadline,
                           std::string_view what) {
  // The driver completes by its deadline; the margin lets its more telling error arrive first.
  auto state = pending.Wait(deadline + device_timeout(), absl::StrCat(AxisName(id), ": ", what));
  if (!state.ok()) return Named(state.status(), AxisName(id));
  StoreAxis(id, *state);
  return absl::OkStatus();
}

absl::StatusOr<AxisState> Rig::ReadAxis(AxisId id) {
  Pending<AxisState> read(clock_);
  TimePoint deadline = clock_.Now() + device_timeout();
  {
    MutexLock lock(&gate_);
    mutable_axis(id)->Read(deadline, read.sink());
  }
  RETURN_IF_ERROR(WaitAxis(id, read, deadline, "read"));
  MutexLock lock(&state_mutex_);
  return axis_state_[static_cast<int>(id)];
}

absl::Status Rig::HomeAxis(AxisId id, uint64_t since, Latch latch,
                           absl::FunctionRef<bool()> cancelled) {
  Pending<AxisState> homed(clock_);
  TimePoint deadline = clock_.Now() + kHomingTimeout;
  {
    MutexLock lock(&gate_);
    if (latch == Latch::kRespect) RETURN_IF_ERROR(CheckRunningLocked());
    RETURN_IF_ERROR(CheckUndisturbedLocked(since));
    mutable_axis(id)->Home(deadline, homed.sink());
  }
  if (!WaitUnless(clock_, homed, deadline, cancelled)) {
    absl::Status status = WaitAxis(id, homed, deadline, "homing");
    if (status.ok()) return status;
    if (absl::Status still = StopAxis(id); !still.ok()) spdlog::warn("{}", MessageOf(still));
    return status;
  }
  RETURN_IF_ERROR(StopAxis(id));
  return Error(absl::StatusCode::kCancelled, "STOPPED",
               absl::StrCat(std::string(AxisName(id)), " was stopped while it was homed"),
               {{"axis", std::string(AxisName(id))}});
}

absl::Status Rig::HomeAll(uint64_t since, Latch latch) {
  for (AxisId id : kAxes)
    if (mutable_axis(id)) RETURN_IF_ERROR(HomeAxis(id, since, latch));
  return absl::OkStatus();
}

absl::Status Rig::HomeAll() { return HomeAll(disturbances(), Latch::kRespect); }

std::unique_ptr<Rig::Posing> Rig::StartPose(const Pose& pose) {
  auto posing = std::make_unique<Posing>();
  posing->rig_ = this;
  uint64_t since = disturbances();
  for (AxisId id : kAxes) {
    Angle target = id == AxisId::kTurntable ? pose.azimuth : pose.tilt;
    Axis* axis = mutable_axis(id);
    if (!axis) {
      if (target != Degrees(0)) posing->refused_ = MissingDevice(AxisName(id), "a position");
      continue;
    }
    AxisState now;
    {
      MutexLock lock(&state_mutex_);
      now = axis_state_[static_cast<int>(id)];
    }
    if (now.moving) {  // a move that failed
      auto read = ReadAxis(id);
      if (!read.ok()) {
        posing->refused_ = read.status();
        break;
      }
      now = *read;
    }
    if (!now.homed) {
      posing->refused_ = HomeAxis(id, since, Latch::kRespect);
      if (!posing->refused_.ok()) break;
      now.position = Degrees(0);
    }
    Angle way = MoveDistance(axis->info(), now.position, target);
    if (now.homed && !now.moving && std::abs(way.degrees()) <= axis->info().tolerance.degrees())
      continue;
    TimePoint deadline =
        clock_.Now() + MoveDuration(axis->info(), now.position, target) + device_timeout();
    posing->motions_.push_back({id, Pending<AxisState>(clock_), deadline, target});
    MutexLock lock(&gate_);
    posing->refused_ = CheckRunningLocked();
    if (!posing->refused_.ok()) {
      posing->motions_.pop_back();
      break;
    }
    MarkMoving(id);
    axis->Move(target, 0, deadline, posing->motions_.back().pending.sink());
  }
  return posing;
}

absl::Status Rig::Posing::Wait() {
  absl::Status first = refused_;
  for (Motion& motion : motions_) {
    absl::Status status =
        rig_->WaitAxis(motion.axis, motion.pending, motion.deadline,
                       absl::StrFormat("move to %g deg", motion.target.degrees()));
    if (status.ok()) continue;
    // It may still be on its way, or think that it is: whatever comes next must find it at rest.
    absl::Status stopped = rig_->StopAxis(motion.axis);
    if (!stopped.ok()) spdlog::warn("{}", MessageOf(stopped));
    if (first.ok()) first = status;
  }
  return first;
}

absl::StatusOr<AxisState> Rig::MoveAxis(AxisId id, Angle target, double velocity_dps,
                                        absl::FunctionRef<bool()> cancelled) {
  Axis* axis = mutable_axis(id);
  if (!axis) return MissingDevice(AxisName(id), "a move");
  RETURN_IF_ERROR(CheckTarget(axis->info(), target));
  uint64_t since = disturbances();
  ASSIGN_OR_RETURN(const AxisState now, ReferencedAxis(id, since, cancelled));
  TimePoint deadline = clock_.Now() +
                       MoveDuration(axis->info(), now.position, target, velocity_dps) +
                       device_timeout();
  Pending<AxisState> moved(clock_);
  {
    MutexLock lock(&gate_);
    RETURN_IF_ERROR(CheckRunningLocked());
    RETURN_IF_ERROR(CheckUndisturbedLocked(since));
    MarkMoving(id);
    axis->Move(target, velocity_dps, deadline, moved.sink());
  }
  if (WaitUnless(clock_, moved, deadline, cancelled)) RETURN_IF_ERROR(Halt());
  return EndByHand(id, moved, deadline, absl::StrFormat("move to %g deg", target.degrees()));
}

absl::StatusOr<AxisState> Rig::JogAxis(AxisId id, double velocity_dps, Duration time,
                                       absl::FunctionRef<bool()> cancelled) {
  Axis* axis = mutable_axis(id);
  if (!axis) return MissingDevice(AxisName(id), "a jog");
  const AxisInfo& info = axis->info();
  RETURN_IF_ERROR(CheckVelocity(info, velocity_dps));
  const uint64_t since = disturbances();
  const Angle low = id == AxisId::kTurntable ? file_.limits.azimuth_min : file_.limits.tilt_min,
              high = id == AxisId::kTurntable ? file_.limits.azimuth_max : file_.limits.tilt_max;
  if (info.continuous && high - low < Degrees(360)) {
    return Error(absl::StatusCode::kFailedPrecondition, "AXIS_LIMITED",
                 absl::StrFormat("%s: the rig file allows %g to %g deg, which is less than a turn; "
                                 "it can be moved, but not turned without end",
                                 AxisName(id), low.degrees(), high.degrees()),
                 {{"axis", std::string(AxisName(id))}});
  }
  ASSIGN_OR_RETURN(const AxisState now, ReferencedAxis(id, since, cancelled));
  const Angle limit = velocity_dps > 0 ? std::min(high, info.max) : std::max(low, info.min);
  if (!info.continuous && (limit - now.position).degrees() * velocity_dps < 0) {
    return Error(
        absl::StatusCode::kOutOfRange, "AXIS_LIMIT",
        absl::StrFormat("%s stands at %g deg, beyond its limit of %g deg: it can be moved, "
                        "or jogged the other way",
                        AxisName(id), now.position.degrees(), limit.degrees()),
        {{"axis", std::string(AxisName(id))}});
  }
  const TimePoint end = clock_.Now() + time;
  // The driver's own end is for a daemon that hangs.
  const TimePoint deadline = end + BrakingTime(info) + device_timeout();
  Pending<AxisState> motion(clock_);
  {
    MutexLock lock(&gate_);
    RETURN_IF_ERROR(CheckRunningLocked());
    RETURN_IF_ERROR(CheckUndisturbedLocked(since));
    MarkMoving(id);
    if (info.continuous) {
      axis->Turn(velocity_dps, deadline, motion.sink());
    } else {
      axis->Move(limit, std::abs(velocity_dps), deadline, motion.sink());
    }
  }
  WaitUnless(clock_, motion, end, cancelled);
  if (motion.done()) {  // at its limit, or something went wrong
    return EndByHand(id, motion, deadline, absl::StrFormat("jog at %g deg/s", velocity_dps));
  }
  RETURN_IF_ERROR(StopAxis(id));
  RETURN_IF_ERROR(CheckUndisturbed(since));
  MutexLock lock(&state_mutex_);
  return axis_state_[static_cast<int>(id)];
}

absl::StatusOr<AxisState> Rig::ReferencedAxis(AxisId id, uint64_t since,
                                              absl::FunctionRef<bool()> cancelled) {
  ASSIGN_OR_RETURN(const AxisState now, ReadAxis(id));
  if (now.homed) return now;
  RETURN_IF_ERROR(HomeAxis(id, since, Latch::kRespect, cancelled));
  return ReadAxis(id);
}

absl::StatusOr<AxisState> Rig::EndByHand(AxisId id, Pending<AxisState>& motion, TimePoint deadline,
                                         std::string_view what) {
  absl::Status ended = WaitAxis(id, motion, deadline, what);
  if (!ended.ok()) {
    absl::Status still = StopAxis(id);
    if (!still.ok()) spdlog::warn("{}", MessageOf(still));
    return ended;
  }
  MutexLock lock(&state_mutex_);
  return axis_state_[static_cast<int>(id)];
}

absl::StatusOr<Pose> Rig::ReadPose() {
  Pose pose;
  for (AxisId id : kAxes) {
    if (!mutable_axis(id)) continue;
    ASSIGN_OR_RETURN(AxisState state, ReadAxis(id));
    (id == AxisId::kTurntable ? pose.azimuth : pose.tilt) = state.position;
  }
  return pose;
}

Rig::Standstill Rig::StartStopLocked(std::initializer_list<AxisId> ids) {
  Standstill standstill;
  standstill.deadline = clock_.Now() + device_timeout();
  for (AxisId id : ids) {
    Axis* axis = mutable_axis(id);
    if (!axis) continue;
    standstill.axes.emplace_back(id, Pending<AxisState>(clock_));
    standstill.deadline =
        std::max(standstill.deadline, clock_.Now() + device_timeout() + BrakingTime(axis->info()));
    axis->Stop(standstill.deadline, standstill.axes.back().second.sink());
  }
  return standstill;
}

absl::Status Rig::FinishStop(Standstill& standstill) {
  absl::Status first;
  for (auto& [id, stop] : standstill.axes) {
    absl::Status status = WaitAxis(id, stop, standstill.deadline, "stop");
    if (first.ok()) first = status;
  }
  return first;
}

absl::Status Rig::StopAxis(AxisId id) {
  Standstill standstill;
  {
    MutexLock lock(&gate_);
    standstill = StartStopLocked({id});
  }
  return FinishStop(standstill);
}

}  // namespace lightstage
