#include "daemon/rig/rig.h"

#include <cmath>

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "daemon/rig/device_errors.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

constexpr AxisId kAxes[] = {AxisId::kTurntable, AxisId::kTilt};

// Why the rig is latched during a reset that no stop came before.
constexpr char kResetting[] = "RESETTING";

// An unset lamp_time_to_dark_ms, where the lamps have such a timer.
constexpr Duration kTimeToDark = std::chrono::seconds(3);

}  // namespace

const char* AxisName(AxisId id) { return id == AxisId::kTurntable ? "turntable" : "tilt"; }

Rig::Rig(const RigFile& file, Clock& clock)
    : file_(file), clock_(clock), refresh_guard_(std::make_shared<RefreshGuard>()) {
  MutexLock lock(&refresh_guard_->mutex);
  refresh_guard_->rig = this;
}

Rig::~Rig() {
  if (lamps_ || projector_) {
    absl::Status dark = Dark();
    if (!dark.ok()) spdlog::error("rig: not confirmed dark at close: {}", MessageOf(dark));
  }
  MutexLock lock(&refresh_guard_->mutex);  // waits for a refresh that is running
  refresh_guard_->rig = nullptr;
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

  if (lamps_) RETURN_IF_ERROR(OpenLamps());
  RETURN_IF_ERROR(Dark());
  for (AxisId id : kAxes) {
    if (mutable_axis(id)) RETURN_IF_ERROR(ReadAxis(id).status());
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
  return ConfigureCamera();
}

absl::Status Rig::OpenLamps() {
  int geometry = static_cast<int>(file_.geometry.brace.lamps.size());
  if (lamps_->info().count < geometry) {
    return Error(
        absl::StatusCode::kFailedPrecondition, "LAMP_COUNT",
        absl::StrFormat("lamps: the device has %d channels, [geometry.brace] has %d lamps",
                        lamps_->info().count, geometry),
        {{"channels", absl::StrCat(lamps_->info().count)}, {"lamps", absl::StrCat(geometry)}});
  }
  time_to_dark_ = file_.engine.lamp_time_to_dark.value_or(
      std::min(kTimeToDark, lamps_->info().max_time_to_dark));
  if (time_to_dark_ > Duration::zero()) RETURN_IF_ERROR(lamps_->SetTimeToDark(time_to_dark_));
  MutexLock lock(&state_mutex_);
  lamp_levels_.assign(lamps_->info().count, 0.0f);
  lamps_asked_ = lamp_levels_;
  return absl::OkStatus();
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

absl::Status Rig::stop_reason() const {
  MutexLock lock(&gate_);
  return stop_reason_;
}

uint64_t Rig::disturbances() const {
  MutexLock lock(&gate_);
  return disturbances_;
}

absl::Status Rig::CheckUndisturbedLocked(uint64_t since) const {
  if (disturbances_ == since) return absl::OkStatus();
  return Error(absl::StatusCode::kAborted, "RIG_DISTURBED",
               "light or motion was taken away meanwhile (stop, lost control, or lamps that went "
               "dark by themselves)");
}

absl::Status Rig::CheckUndisturbed(uint64_t since) {
  MutexLock lock(&gate_);
  {
    MutexLock state_lock(&state_mutex_);
    CheckStillLitLocked();
  }
  RETURN_IF_ERROR(CheckRunningLocked());
  return CheckUndisturbedLocked(since);
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

// ---- Camera

absl::Status Rig::ConfigureCamera() {
  TimePoint deadline = clock_.Now() + 10 * device_timeout();
  Pending<CameraConfig> configured(clock_);
  camera_->Configure(file_.camera_options.config, deadline, configured.sink());
  return Named(configured.Wait(deadline + device_timeout(), "camera: configure").status(),
               "camera");
}

absl::Status Rig::ArmCamera() {
  if (camera_suspect_) {
    (void)DisarmCamera();  // what it was doing is of no interest; whether it can be used again is
    RETURN_IF_ERROR(ConfigureCamera());
    camera_suspect_ = false;
  }
  if (camera_armed_) return absl::OkStatus();
  TimePoint deadline = clock_.Now() + 5 * device_timeout();
  Pending<CameraConfig> armed(clock_);
  camera_->Arm(deadline, armed.sink());
  absl::Status status =
      Named(armed.Wait(deadline + device_timeout(), "camera: arm").status(), "camera");
  camera_armed_ = status.ok();
  camera_suspect_ = !status.ok();
  return status;
}

absl::Status Rig::DisarmCamera() {
  camera_armed_ = false;
  TimePoint deadline = clock_.Now() + 5 * device_timeout();
  Pending<CameraConfig> disarmed(clock_);
  camera_->Disarm(deadline, disarmed.sink());
  return Named(disarmed.Wait(deadline + device_timeout(), "camera: disarm").status(), "camera");
}

// ---- Stop

Rig::Stopping Rig::StopDevicesLocked() {
  ++disturbances_;
  return {StartDarkLocked(), StartStopLocked({AxisId::kTurntable, AxisId::kTilt})};
}

absl::Status Rig::Finish(Stopping& stopping) {
  absl::Status dark = FinishDark(stopping.darkening);
  absl::Status still = FinishStop(stopping.standstill);
  return dark.ok() ? still : dark;
}

// Logs only after the devices have been told: a log may block.
absl::Status Rig::Stop(const absl::Status& reason) {
  Stopping stopping;
  {
    MutexLock lock(&gate_);
    // The first reason is the cause.
    if (stop_reason_.ok() || ErrorReason(stop_reason_) == kResetting) stop_reason_ = reason;
    stopping = StopDevicesLocked();
  }
  absl::Status stopped = Finish(stopping);
  spdlog::warn("rig: stop: {}", MessageOf(reason));
  return stopped;
}

absl::Status Rig::Halt() {
  Stopping stopping;
  {
    MutexLock lock(&gate_);
    stopping = StopDevicesLocked();
  }
  return Finish(stopping);
}

absl::Status Rig::HaltManual() {
  bool idle;
  {
    MutexLock lock(&gate_);
    if (use_ == RigUse::kRun) return absl::OkStatus();
    idle = use_ == RigUse::kNone;
    use_ = RigUse::kManual;
  }
  absl::Status halted = Halt();
  if (idle) Release();
  return halted;
}

absl::Status Rig::Reset() {
  uint64_t since;
  Stopping stopping;
  {
    MutexLock lock(&gate_);
    if (resetting_) {
      return Error(absl::StatusCode::kFailedPrecondition, "RIG_BUSY",
                   "a reset is in progress; wait for its end");
    }
    resetting_ = true;
    if (stop_reason_.ok())
      stop_reason_ = Error(absl::StatusCode::kAborted, kResetting, "a reset is in progress");
    stopping = StopDevicesLocked();  // a stalled axis is still busy with its last move
    since = disturbances_;
  }
  absl::Status ready = FinishDark(stopping.darkening);
  // An axis that does not confirm its stop may have a fault or have been lost: homing is what ends that, and finds it at rest first.
  if (absl::Status still = FinishStop(stopping.standstill); !still.ok()) {
    spdlog::warn("rig: reset: {}", MessageOf(still));
  }
  if (ready.ok()) ready = HomeAll(since, Latch::kResetting);
  MutexLock lock(&gate_);
  resetting_ = false;
  if (ready.ok()) ready = CheckUndisturbedLocked(since);
  if (!ready.ok()) {
    if (ErrorReason(stop_reason_) == kResetting) stop_reason_ = ready;
    return Annotate(ready, "reset");
  }
  stop_reason_ = absl::OkStatus();
  spdlog::info("rig: reset");
  return ready;
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
