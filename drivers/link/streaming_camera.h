// Cameras whose calls block and that stream frames: what of the Camera contract is the same for all of them is kept here. A driver derives
// from it and brings what its device's thread does.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "drivers/api/camera.h"
#include "drivers/link/device_thread.h"

namespace lightstage {

class StreamingCamera : public Camera {
 public:
  const CameraInfo& info() const final { return info_; }
  void Configure(const CameraConfig& config, TimePoint deadline,
                 Completion<CameraConfig> done) final;
  void Arm(TimePoint deadline, Completion<CameraConfig> done) final;
  void Trigger(Duration exposure, TimePoint deadline, Completion<ExposureEnd> exposure_ended,
               Completion<Frame> frame_ready) final;
  void Disarm(TimePoint deadline, Completion<CameraConfig> done) final;

 protected:
  // A driver's destructor begins with thread_.Close(): what follows here runs on the driver's members.
  explicit StreamingCamera(const DeviceContext& context);

  // ---- The device's thread.

  // Applies `config`, which is valid, and leaves in config_ what the camera read back. Connects anew if the camera was lost.
  virtual absl::Status DoConfigure(const CameraConfig& config) = 0;
  // Starts the stream. May give up once `operation` is finished.
  virtual absl::Status DoArm(const Outstanding& operation, TimePoint deadline) = 0;
  // Whatever comes of it ends the shot. The shot may be finished already.
  virtual void DoTrigger(const std::shared_ptr<CameraShot>& shot) = 0;
  // Ends the stream.
  virtual void DoDisarm() = 0;

  // ---- Any thread.

  // A task was posted: for a device's thread that may be waiting for a frame.
  virtual void Wake() {}
  // FAILED_PRECONDITION with the camera's name.
  absl::Status Refusal(std::string_view reason, std::string_view message) const;

  const std::string name_;
  Clock& clock_;
  CameraInfo info_;      // filled in before the camera is anybody's
  CameraConfig config_;  // as the camera read it back; the device's thread only

 private:
  absl::Status TriggerRefusalLocked(Duration exposure) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  Mutex mutex_;
  bool armed_ ABSL_GUARDED_BY(mutex_) = false;
  uint64_t disarms_ ABSL_GUARDED_BY(mutex_) = 0;  // an Arm that a Disarm overtook does not arm
  std::shared_ptr<CameraShot> shot_ ABSL_GUARDED_BY(mutex_);  // the last one triggered

 protected:
  DeviceThread thread_;  // last: its tasks use all of this
};

}  // namespace lightstage
