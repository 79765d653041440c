// The rig's axes: homing, poses, moves by hand.
#include <cmath>

#include "absl/strings/str_format.h"
#include "daemon/rig/missing.h"
#include "daemon/rig/rig.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

constexpr AxisId kAxes[] = {AxisId::kTurntable, AxisId::kTilt};

// Homing speed is the drive's own business: this only bounds the wait.
constexpr Duration kHomingTimeout = std::chrono::seconds(120);

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
  if (!state.ok()) return Annotate(state.status(), AxisName(id));
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

absl::Status Rig::HomeAxis(AxisId id, uint64_t since, Latch latch) {
  Pending<AxisState> homed(clock_);
  TimePoint deadline = clock_.Now() + kHomingTimeout;
  {
    MutexLock lock(&gate_);
    if (latch == Latch::kRespect) RETURN_IF_ERROR(CheckRunningLocked());
    RETURN_IF_ERROR(CheckUndisturbedLocked(since));
    mutable_axis(id)->Home(deadline, homed.sink());
  }
  return WaitAxis(id, homed, deadline, "homing");
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
  ASSIGN_OR_RETURN(AxisState now, ReadAxis(id));
  if (!now.homed) RETURN_IF_ERROR(HomeAxis(id, since, Latch::kRespect));
  ASSIGN_OR_RETURN(now, ReadAxis(id));
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
  // In slices, because the client's cancellation wakes nobody.
  bool stopped = false;
  while (!moved.done() && clock_.Now() < deadline) {
    if (!stopped && cancelled()) {
      stopped = true;
      RETURN_IF_ERROR(Halt());
    }
    clock_.WaitUntil(std::min(deadline, clock_.Now() + std::chrono::milliseconds(50)),
                     [&] { return moved.done(); });
  }
  absl::Status arrived =
      WaitAxis(id, moved, deadline, absl::StrFormat("move to %g deg", target.degrees()));
  if (!arrived.ok()) {
    absl::Status still = StopAxis(id);
    if (!still.ok()) spdlog::warn("{}", MessageOf(still));
    return arrived;
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
    // Slowing down takes as long as speeding up did.
    const AxisInfo& info = axis->info();
    standstill.deadline = std::max(
        standstill.deadline, clock_.Now() + device_timeout() +
                                 FromSeconds(info.max_velocity_dps / info.max_acceleration_dps2));
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
