#include "drivers/link/streaming_camera.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace lightstage {

StreamingCamera::StreamingCamera(const DeviceContext& context)
    : name_(context.name), clock_(*context.clock), thread_(context.name, *context.clock) {}

absl::Status StreamingCamera::Refusal(std::string_view reason, std::string_view message) const {
  return Error(absl::StatusCode::kFailedPrecondition, reason, absl::StrCat(name_, ": ", message),
               {{"device", name_}});
}

absl::Status StreamingCamera::TriggerRefusalLocked(Duration exposure) {
  if (ExposureResult real = ValidateExposure(exposure); real.verdict != ConfigVerdict::kValid) {
    return Error(absl::StatusCode::kOutOfRange, "EXPOSURE_RANGE",
                 absl::StrCat(name_, ": ", real.note),
                 {{"device", name_}, {"exposure_us", absl::StrCat(Seconds(exposure) * 1e6)}});
  }
  if (!armed_) return Refusal("CAMERA_NOT_ARMED", "must be armed before it is triggered");
  if (shot_ && !shot_->finished()) {
    return Refusal("CAMERA_BUSY", "triggered again before the last frame was ready");
  }
  return absl::OkStatus();
}

void StreamingCamera::Configure(const CameraConfig& config, TimePoint deadline,
                                Completion<CameraConfig> done) {
  bool armed;
  {
    MutexLock lock(&mutex_);
    armed = armed_;
  }
  if (armed) {
    return std::move(done)(Refusal("CAMERA_ARMED", "can not be configured while armed"));
  }
  if (ConfigResult result = Validate(config); result.verdict != ConfigVerdict::kValid) {
    return std::move(done)(Error(absl::StatusCode::kInvalidArgument, "CAMERA_CONFIG",
                                 absl::StrCat(name_, ": ", result.notes.front()),
                                 {{"device", name_}, {"note", result.notes.front()}}));
  }
  auto operation = thread_.Start(std::move(done), deadline, "Configure");
  thread_.Post([this, operation, config] {
    if (operation->finished()) return;
    if (absl::Status status = DoConfigure(config); !status.ok()) {
      operation->Fail(status);
      return;
    }
    operation->Complete(config_);
  });
}

void StreamingCamera::Arm(TimePoint deadline, Completion<CameraConfig> done) {
  auto operation = thread_.Start(std::move(done), deadline, "Arm");
  uint64_t disarms;
  {
    MutexLock lock(&mutex_);
    disarms = disarms_;
  }
  thread_.Post([this, operation, deadline, disarms] {
    if (operation->finished()) return;
    if (absl::Status status = DoArm(*operation, deadline); !status.ok()) {
      operation->Fail(status);
      return;
    }
    {
      MutexLock lock(&mutex_);
      armed_ = disarms == disarms_ && !operation->finished();  // one that was too late has failed
    }
    operation->Complete(config_);
  });
  Wake();
}

void StreamingCamera::Trigger(Duration exposure, TimePoint deadline,
                              Completion<ExposureEnd> exposure_ended,
                              Completion<Frame> frame_ready) {
  auto shot = std::make_shared<CameraShot>(exposure, deadline, std::move(exposure_ended),
                                           std::move(frame_ready));
  shot->sent = clock_.Now();  // the light is right from here on
  absl::Status refusal;
  {
    MutexLock lock(&mutex_);
    refusal = TriggerRefusalLocked(exposure);
    if (refusal.ok()) {
      shot_ = shot;
      // In one breath, so that Disarm finds both or neither.
      thread_.Track(shot, deadline, "the frame");
    }
  }
  if (!refusal.ok()) {
    shot->Fail(refusal);
    return;
  }
  thread_.Post([this, shot] { DoTrigger(shot); });
  Wake();
}

void StreamingCamera::Disarm(TimePoint deadline, Completion<CameraConfig> done) {
  {
    MutexLock lock(&mutex_);
    armed_ = false;
    ++disarms_;
  }
  thread_.FailAll(Error(absl::StatusCode::kCancelled, "CAMERA_DISARMED",
                        absl::StrCat(name_, ": disarmed"), {{"device", name_}}));
  auto operation = thread_.Start(std::move(done), deadline, "Disarm");
  thread_.Post([this, operation] {
    DoDisarm();
    operation->Complete(config_);
  });
  Wake();
}

}  // namespace lightstage
