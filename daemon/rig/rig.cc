#include "daemon/rig/rig.h"

#include <cmath>

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

constexpr AxisId kAxes[] = {AxisId::kTurntable, AxisId::kTilt};

// Homing speed is the drive's own business: this only bounds the wait.
constexpr Duration kHomingTimeout = std::chrono::seconds(120);

absl::Status NotThere(std::string_view device, std::string_view asked) {
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_MISSING",
               absl::StrFormat("%s asked for, but the rig file has no [%s]", asked, device),
               {{"device", std::string(device)}, {"asked", std::string(asked)}});
}

}  // namespace

const char* AxisName(AxisId id) { return id == AxisId::kTurntable ? "turntable" : "tilt"; }

Rig::Rig(const RigFile& file, Clock& clock) : file_(file), clock_(clock) {}

Rig::~Rig() {
  if (lamps_ || projector_) {
    absl::Status dark = Dark();
    if (!dark.ok()) spdlog::error("rig: not confirmed dark at close: {}", MessageOf(dark));
  }
  bool refreshing;
  Clock::TimerId timer;
  {
    MutexLock lock(&state_mutex_);
    refreshing = refreshing_;
    timer = refresh_timer_;
    lamp_levels_.clear();
  }
  // A refresh that is running ends by itself: with every lamp dark it does not come back.
  if (refreshing && !clock_.Cancel(timer)) SleepFor(clock_, std::chrono::milliseconds(1));
}

absl::StatusOr<std::unique_ptr<Rig>> Rig::Open(const RigFile& file, Clock& clock) {
  auto rig = std::unique_ptr<Rig>(new Rig(file, clock));
  RETURN_IF_ERROR(rig->OpenDevices());
  return rig;
}

absl::Status Rig::OpenDevices() {
  auto open = [&](auto& table, auto& device, const char* name) -> absl::Status {
    if (!table.present) return absl::OkStatus();
    auto opened = table.open({.name = name, .clock = &clock_, .geometry = &file_.geometry});
    if (!opened.ok())
      return Annotate(opened.status(), absl::StrFormat("[%s] (driver %s)", name, table.driver));
    device = *std::move(opened);
    const DeviceIdentity& id = device->info().identity;
    spdlog::info("{}: {} {} {}", name, id.driver, id.model, id.serial);
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(open(file_.lamps, lamps_, "lamps"));
  RETURN_IF_ERROR(open(file_.projector, projector_, "projector"));
  RETURN_IF_ERROR(open(file_.turntable, turntable_, "turntable"));
  RETURN_IF_ERROR(open(file_.tilt, tilt_, "tilt"));
  RETURN_IF_ERROR(open(file_.camera, camera_, "camera"));

  if (lamps_) {
    int geometry = static_cast<int>(file_.geometry.brace.lamps.size());
    if (lamps_->info().count < geometry) {
      return Error(
          absl::StatusCode::kFailedPrecondition, "LAMP_COUNT",
          absl::StrFormat("lamps: the device has %d channels, [geometry.brace] has %d lamps",
                          lamps_->info().count, geometry),
          {{"channels", absl::StrCat(lamps_->info().count)}, {"lamps", absl::StrCat(geometry)}});
    }
    if (file_.engine.lamp_time_to_dark > Duration::zero())
      RETURN_IF_ERROR(lamps_->SetTimeToDark(file_.engine.lamp_time_to_dark));
    MutexLock lock(&state_mutex_);
    lamp_levels_.assign(lamps_->info().count, 0.0f);
  }
  RETURN_IF_ERROR(Dark());
  for (AxisId id : kAxes) {
    Axis* axis = mutable_axis(id);
    if (!axis) continue;
    Pending<AxisState> read(clock_);
    TimePoint deadline = clock_.Now() + device_timeout();
    axis->Read(deadline, read.sink());
    RETURN_IF_ERROR(WaitAxis(id, read, deadline, "read"));
  }

  const CameraConfig& asked = file_.camera_options.config;
  ConfigResult result = camera_->Validate(asked);
  if (result.verdict != ConfigVerdict::kValid) {
    std::string notes;
    for (const auto& note : result.notes) absl::StrAppend(&notes, "; ", note);
    return Error(absl::StatusCode::kInvalidArgument, "CAMERA_CONFIG",
                 absl::StrCat("camera: cannot do what [camera] asks",
                              result.verdict == ConfigVerdict::kAdjusted ? " exactly" : "", notes),
                 {{"notes", notes}});
  }
  TimePoint deadline = clock_.Now() + 10 * device_timeout();
  Pending<CameraConfig> configured(clock_);
  camera_->Configure(asked, deadline, configured.sink());
  return configured.Wait(deadline + device_timeout(), "camera: configure").status();
}

WallTime Rig::WallNow() const {
  return std::chrono::time_point_cast<std::chrono::microseconds>(absl::ToChronoTime(absl::Now()));
}

// ---- Use

absl::Status Rig::CheckRunningLocked() const {
  if (stop_reason_.ok()) return absl::OkStatus();
  return Error(absl::StatusCode::kFailedPrecondition, "RIG_STOPPED",
               absl::StrCat("the rig is stopped (", stop_reason_.message(), "); reset it first"),
               {{"stop_reason", std::string(stop_reason_.message())}});
}

absl::Status Rig::CheckRunning() const {
  MutexLock lock(&gate_);
  return CheckRunningLocked();
}

absl::Status Rig::Acquire(RigUse use) {
  MutexLock lock(&gate_);
  RETURN_IF_ERROR(CheckRunningLocked());
  if (use_ == RigUse::kRun)
    return Error(absl::StatusCode::kFailedPrecondition, "RUN_ACTIVE",
                 "a run is using the rig; cancel it or wait for its end");
  if (use_ == RigUse::kManual)
    return Error(absl::StatusCode::kFailedPrecondition, "RIG_BUSY",
                 "another operation is using the rig; wait for its end");
  use_ = use;
  return absl::OkStatus();
}

void Rig::Release() {
  MutexLock lock(&gate_);
  use_ = RigUse::kNone;
}

RigUse Rig::use() const {
  MutexLock lock(&gate_);
  return use_;
}

// ---- Axes

void Rig::StoreAxis(AxisId id, const AxisState& state) {
  MutexLock lock(&state_mutex_);
  axis_state_[static_cast<int>(id)] = state;
}

absl::Status Rig::WaitAxis(AxisId id, Pending<AxisState>& pending, TimePoint deadline,
                           std::string_view what) {
  // The driver completes by its deadline; the margin lets its more telling error arrive first.
  auto state = pending.Wait(deadline + device_timeout(), absl::StrCat(AxisName(id), ": ", what));
  if (!state.ok()) return Annotate(state.status(), AxisName(id));
  StoreAxis(id, *state);
  return absl::OkStatus();
}

absl::Status Rig::HomeAxis(AxisId id) {
  Pending<AxisState> homed(clock_);
  TimePoint deadline = clock_.Now() + kHomingTimeout;
  {
    MutexLock lock(&gate_);
    RETURN_IF_ERROR(CheckRunningLocked());
    mutable_axis(id)->Home(deadline, homed.sink());
  }
  return WaitAxis(id, homed, deadline, "homing");
}

absl::Status Rig::HomeAll() {
  for (AxisId id : kAxes)
    if (mutable_axis(id)) RETURN_IF_ERROR(HomeAxis(id));
  return absl::OkStatus();
}

std::unique_ptr<Rig::Posing> Rig::StartPose(const Pose& pose) {
  auto posing = std::make_unique<Posing>();
  posing->rig_ = this;
  for (AxisId id : kAxes) {
    Angle target = id == AxisId::kTurntable ? pose.azimuth : pose.tilt;
    Axis* axis = mutable_axis(id);
    if (!axis) {
      if (target != Degrees(0)) posing->refused_ = NotThere(AxisName(id), "a position");
      continue;
    }
    AxisState now;
    {
      MutexLock lock(&state_mutex_);
      now = axis_state_[static_cast<int>(id)];
    }
    if (!now.homed) {
      posing->refused_ = HomeAxis(id);
      if (!posing->refused_.ok()) break;
      now.position = Degrees(0);
    }
    Angle way = MoveDistance(axis->info(), now.position, target);
    if (now.homed && std::abs(way.degrees()) <= axis->info().tolerance.degrees()) continue;
    TimePoint deadline =
        clock_.Now() + MoveDuration(axis->info(), now.position, target) + device_timeout();
    posing->motions_.push_back({id, Pending<AxisState>(clock_), deadline, target});
    MutexLock lock(&gate_);
    posing->refused_ = CheckRunningLocked();
    if (!posing->refused_.ok()) {
      posing->motions_.pop_back();
      break;
    }
    {
      // Until it has confirmed, nobody knows where it is: a failed move must not count as "already there".
      MutexLock state_lock(&state_mutex_);
      axis_state_[static_cast<int>(id)].moving = true;
      axis_state_[static_cast<int>(id)].position = Degrees(std::nan(""));
    }
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
    absl::Status stopped = rig_->StopAxes({motion.axis});
    if (!stopped.ok()) spdlog::warn("{}", MessageOf(stopped));
    if (first.ok()) first = status;
  }
  return first;
}

absl::StatusOr<AxisState> Rig::MoveAxis(AxisId id, Angle target, double velocity_dps,
                                        absl::FunctionRef<bool()> cancelled) {
  Axis* axis = mutable_axis(id);
  if (!axis) return NotThere(AxisName(id), "a move");
  RETURN_IF_ERROR(CheckTarget(axis->info(), target));
  AxisState now;
  {
    MutexLock lock(&state_mutex_);
    now = axis_state_[static_cast<int>(id)];
  }
  if (!now.homed) RETURN_IF_ERROR(HomeAxis(id));
  ASSIGN_OR_RETURN(Pose here, ReadPose());
  Angle from = id == AxisId::kTurntable ? here.azimuth : here.tilt;
  TimePoint deadline =
      clock_.Now() + MoveDuration(axis->info(), from, target, velocity_dps) + device_timeout();
  Pending<AxisState> moved(clock_);
  {
    MutexLock lock(&gate_);
    RETURN_IF_ERROR(CheckRunningLocked());
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
  RETURN_IF_ERROR(
      WaitAxis(id, moved, deadline, absl::StrFormat("move to %g deg", target.degrees())));
  MutexLock lock(&state_mutex_);
  return axis_state_[static_cast<int>(id)];
}

absl::StatusOr<Pose> Rig::ReadPose() {
  Pose pose;
  for (AxisId id : kAxes) {
    Axis* axis = mutable_axis(id);
    if (!axis) continue;
    Pending<AxisState> read(clock_);
    TimePoint deadline = clock_.Now() + device_timeout();
    {
      MutexLock lock(&gate_);
      axis->Read(deadline, read.sink());
    }
    RETURN_IF_ERROR(WaitAxis(id, read, deadline, "read"));
    MutexLock lock(&state_mutex_);
    (id == AxisId::kTurntable ? pose.azimuth : pose.tilt) =
        axis_state_[static_cast<int>(id)].position;
  }
  return pose;
}

// ---- Light

std::unique_ptr<Rig::Lighting> Rig::StartCondition(const Condition& condition) {
  auto lighting = std::make_unique<Lighting>();
  lighting->rig_ = this;
  Duration settle{};
  if (lamps_) {
    lighting->levels_.assign(lamps_->info().count, 0.0f);
    settle = lamps_->info().settle;
  } else if (!condition.lamps.empty()) {
    lighting->refused_ = NotThere("lamps", "lamps");
    return lighting;
  }
  if (!projector_ && condition.pattern) {
    lighting->refused_ = NotThere("projector", "a pattern");
    return lighting;
  }
  if (projector_) settle = std::max(settle, projector_->info().settle);
  for (const LampLevel& lamp : condition.lamps) {
    if (lamp.lamp < 0 || lamp.lamp >= static_cast<int>(lighting->levels_.size())) {
      lighting->refused_ = Error(absl::StatusCode::kInvalidArgument, "UNKNOWN_LAMP",
                                 absl::StrFormat("lamp %d: the brace has lamps 0 to %d", lamp.lamp,
                                                 static_cast<int>(lighting->levels_.size()) - 1),
                                 {{"lamp", absl::StrCat(lamp.lamp)}});
      return lighting;
    }
    lighting->levels_[lamp.lamp] = static_cast<float>(lamp.level);
  }
  lighting->pattern_ = condition.pattern.value_or(Pattern{});
  lighting->deadline_ = clock_.Now() + settle + device_timeout();

  MutexLock lock(&gate_);
  lighting->refused_ = CheckRunningLocked();
  if (!lighting->refused_.ok()) return lighting;
  bool set_lamps, show;
  {
    MutexLock state_lock(&state_mutex_);
    set_lamps = lamps_ && lighting->levels_ != lamp_levels_;
    show = projector_ && lighting->pattern_ != pattern_;
    // Until confirmed, unknown: a failed command must not count as "already showing it".
    if (set_lamps) lamp_levels_.assign(lamp_levels_.size(), std::nanf(""));
    if (show) pattern_.grid = -1;
  }
  if (set_lamps) {
    lighting->lamps_.emplace(clock_);
    lamps_->Set(lighting->levels_, lighting->deadline_, lighting->lamps_->sink());
  }
  if (show) {
    lighting->projector_.emplace(clock_);
    projector_->Show(lighting->pattern_, lighting->deadline_, lighting->projector_->sink());
  }
  return lighting;
}

absl::Status Rig::Lighting::Wait() {
  absl::Status first = refused_;
  TimePoint deadline = deadline_ + rig_->device_timeout();
  if (lamps_) {
    auto state = lamps_->Wait(deadline, "lamps: set");
    if (state.ok()) {
      {
        MutexLock lock(&rig_->state_mutex_);
        rig_->lamp_levels_ = levels_;
      }
      rig_->KeepLit();
    } else if (first.ok()) {
      first = Annotate(state.status(), "lamps");
    }
  }
  if (projector_) {
    auto state = projector_->Wait(deadline, "projector: show");
    if (state.ok()) {
      MutexLock lock(&rig_->state_mutex_);
      rig_->pattern_ = state->shown;
    } else if (first.ok()) {
      first = Annotate(state.status(), "projector");
    }
  }
  return first;
}

void Rig::KeepLit() {
  if (file_.engine.lamp_time_to_dark == Duration::zero()) return;
  MutexLock lock(&state_mutex_);
  bool lit = false;
  for (float level : lamp_levels_) lit |= level > 0;
  if (refreshing_ || !lit) return;
  refreshing_ = true;
  refresh_timer_ = clock_.At(clock_.Now() + file_.engine.lamp_time_to_dark / 3, [this] {
    absl::Status refreshed = lamps_->Refresh();
    if (!refreshed.ok()) spdlog::warn("lamps: refresh failed: {}", MessageOf(refreshed));
    {
      MutexLock lock(&state_mutex_);
      refreshing_ = false;
    }
    KeepLit();
  });
}

absl::Status Rig::Dark() {
  absl::Status first;
  TimePoint deadline = clock_.Now() + device_timeout();
  std::optional<Pending<LampsState>> lamps;
  std::optional<Pending<ProjectorState>> projector;
  if (lamps_) {
    lamps.emplace(clock_);
    lamps_->Dark(deadline + lamps_->info().settle, lamps->sink());
  }
  if (projector_) {
    projector.emplace(clock_);
    projector_->Black(deadline + projector_->info().settle, projector->sink());
  }
  deadline += device_timeout();
  if (lamps) {
    auto state = lamps->Wait(deadline + lamps_->info().settle, "lamps: dark");
    if (!state.ok()) first = Annotate(state.status(), "lamps");
    MutexLock lock(&state_mutex_);
    lamp_levels_.assign(lamp_levels_.size(), state.ok() ? 0.0f : std::nanf(""));
  }
  if (projector) {
    auto state = projector->Wait(deadline + projector_->info().settle, "projector: black");
    if (!state.ok() && first.ok()) first = Annotate(state.status(), "projector");
    MutexLock lock(&state_mutex_);
    pattern_ = Pattern{};
    if (!state.ok()) pattern_.grid = -1;
  }
  return first;
}

// ---- Camera

absl::Status Rig::ArmCamera() {
  if (camera_armed_) return absl::OkStatus();
  TimePoint deadline = clock_.Now() + 5 * device_timeout();
  Pending<CameraConfig> armed(clock_);
  camera_->Arm(deadline, armed.sink());
  RETURN_IF_ERROR(
      Annotate(armed.Wait(deadline + device_timeout(), "camera: arm").status(), "camera"));
  camera_armed_ = true;
  return absl::OkStatus();
}

absl::Status Rig::DisarmCamera() {
  camera_armed_ = false;
  TimePoint deadline = clock_.Now() + 5 * device_timeout();
  Pending<CameraConfig> disarmed(clock_);
  camera_->Disarm(deadline, disarmed.sink());
  return Annotate(disarmed.Wait(deadline + device_timeout(), "camera: disarm").status(), "camera");
}

// ---- Stop

absl::Status Rig::StopAxes(std::initializer_list<AxisId> ids) {
  std::vector<std::pair<AxisId, Pending<AxisState>>> stops;
  TimePoint deadline = clock_.Now() + device_timeout();
  for (AxisId id : ids) {
    if (Axis* axis = mutable_axis(id)) {
      stops.emplace_back(id, Pending<AxisState>(clock_));
      // Slowing down takes as long as speeding up did.
      const AxisInfo& info = axis->info();
      deadline =
          std::max(deadline, clock_.Now() + device_timeout() +
                                 FromSeconds(info.max_velocity_dps / info.max_acceleration_dps2));
      axis->Stop(deadline, stops.back().second.sink());
    }
  }
  absl::Status first;
  for (auto& [id, stop] : stops) {
    absl::Status status = WaitAxis(id, stop, deadline, "stop");
    if (first.ok()) first = status;
  }
  return first;
}

absl::Status Rig::StopDevices() {
  absl::Status dark = Dark();
  absl::Status still = StopAxes({AxisId::kTurntable, AxisId::kTilt});
  return dark.ok() ? still : dark;
}

absl::Status Rig::Stop(const absl::Status& reason) {
  {
    MutexLock lock(&gate_);
    if (stop_reason_.ok()) stop_reason_ = reason;  // the first reason is the cause
  }
  spdlog::warn("rig: stop: {}", MessageOf(reason));
  return StopDevices();
}

absl::Status Rig::Halt() { return StopDevices(); }

absl::Status Rig::Reset() {
  {
    MutexLock lock(&gate_);
    stop_reason_ = absl::OkStatus();
  }
  absl::Status ready = StopDevices();  // a stalled axis is still busy with its last move
  if (ready.ok()) ready = HomeAll();
  if (ready.ok()) {
    spdlog::info("rig: reset");
    return ready;
  }
  MutexLock lock(&gate_);
  if (stop_reason_.ok()) stop_reason_ = ready;
  return Annotate(ready, "reset");
}

RigSnapshot Rig::Snapshot(bool live) {
  if (live) {
    absl::Status read = ReadPose().status();  // an axis that does not answer keeps its last report
    if (!read.ok()) spdlog::warn("rig: {}", MessageOf(read));
  }
  RigSnapshot snapshot;
  {
    MutexLock lock(&gate_);
    snapshot.stop_reason = stop_reason_;
  }
  MutexLock lock(&state_mutex_);
  for (AxisId id : kAxes)
    if (axis(id)) snapshot.axes.push_back({id, axis_state_[static_cast<int>(id)]});
  snapshot.lamp_levels = lamp_levels_;
  snapshot.pattern = pattern_;
  return snapshot;
}

}  // namespace lightstage
