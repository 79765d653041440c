// The Camera contract over one AravisLink. A thread of its own owns the link and makes all its blocking calls; deadlines fire on
// the rig's clock, so that a camera that does not answer never holds up a caller.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "drivers/aravis/link.h"
#include "drivers/link/device_thread.h"

namespace lightstage {

class AravisCamera final : public Camera {
 public:
  static absl::StatusOr<std::unique_ptr<Camera>> Open(const AravisOptions& options,
                                                      const DeviceContext& context);
  // Also waits for a libaravis call in progress: up to some seconds if the camera does not answer.
  ~AravisCamera() override;

  const CameraInfo& info() const override { return info_; }
  ConfigResult Validate(const CameraConfig& config) const override {
    return capabilities_.Validate(config);
  }
  ExposureResult ValidateExposure(Duration exposure) const override {
    return capabilities_.ValidateExposure(exposure);
  }
  // After control was lost this connects anew, to the same camera.
  void Configure(const CameraConfig& config, TimePoint deadline,
                 Completion<CameraConfig> done) override;
  void Arm(TimePoint deadline, Completion<CameraConfig> done) override;
  void Trigger(Duration exposure, TimePoint deadline, Completion<ExposureEnd> exposure_ended,
               Completion<Frame> frame_ready) override;
  void Disarm(TimePoint deadline, Completion<CameraConfig> done) override;

 private:
  AravisCamera(const AravisOptions& options, const DeviceContext& context);
  absl::StatusOr<std::unique_ptr<AravisLink>> Connect();

  // ---- Any thread.
  void OnControlLost();
  absl::Status LostError() const;
  absl::Status TriggerRefusalLocked(Duration exposure) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // ---- The device's thread.
  absl::StatusOr<CameraConfig> DoConfigure(const CameraConfig& config);
  absl::Status DoArm(TimePoint deadline);
  void DoTrigger(const std::shared_ptr<Shot>& shot);
  void OnFirstPacket(uint64_t session, TimePoint time);
  void OnBuffer(uint64_t session);
  void FinishActive(AravisLink::Taken taken);

  const AravisOptions options_;
  const std::string name_;
  Clock& clock_;
  CameraInfo info_;
  AravisCapabilities capabilities_;

  // The device's thread only, once it runs.
  std::unique_ptr<AravisLink> link_;
  CameraConfig config_;  // as the camera read it back
  bool configured_ = false;
  bool streaming_ = false;
  bool out_of_step_ =
      false;  // a frame came or stayed away that nobody can tell: start the stream anew
  std::shared_ptr<Shot> active_;  // triggered, its frame not yet seen
  uint64_t sequence_base_ = 0;    // frames counted before the last reconnection
  uint64_t last_sequence_ = 0;

  std::atomic<bool> lost_{false};

  Mutex mutex_;
  bool armed_ ABSL_GUARDED_BY(mutex_) = false;
  uint64_t disarms_ ABSL_GUARDED_BY(mutex_) = 0;  // an Arm that a Disarm overtook does not arm
  std::shared_ptr<Shot> shot_ ABSL_GUARDED_BY(mutex_);  // the last one triggered
  DeviceThread thread_;  // last: what its tasks use is there before it and after it
};

}  // namespace lightstage
