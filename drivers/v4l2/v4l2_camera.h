// The Camera contract over one V4l2Link. A thread of its own owns the link: while armed it takes every frame as it comes, gives it back,
// and picks those that belong to a shot (free_running.h). Deadlines fire on the rig's clock.
#pragma once

#include <atomic>
#include <memory>
#include <optional>

#include "drivers/link/streaming_camera.h"
#include "drivers/v4l2/link.h"
#include "drivers/v4l2/waker.h"

namespace lightstage {

class V4l2Camera final : public StreamingCamera {
 public:
  // `system` outlives the camera.
  static absl::StatusOr<std::unique_ptr<Camera>> Open(VideoSystem& system,
                                                      const V4l2Options& options,
                                                      const DeviceContext& context);
  ~V4l2Camera() override;

  ConfigResult Validate(const CameraConfig& config) const override {
    return capabilities_.Validate(config);
  }
  ExposureResult ValidateExposure(Duration exposure) const override;

 private:
  V4l2Camera(VideoSystem& system, const V4l2Options& options, const DeviceContext& context);

  // ---- Any thread.
  absl::Status LostError() const;
  void Wake() override { waker_.Wake(); }

  // ---- The device's thread.
  // After the camera was lost this opens it anew, wherever it is plugged in now.
  absl::Status DoConfigure(const CameraConfig& config) override;
  absl::Status DoArm(const Outstanding& operation, TimePoint deadline) override;
  absl::Status Begin();
  absl::Status SetExposure(Duration exposure);
  void DoTrigger(const std::shared_ptr<CameraShot>& shot) override;
  void DoDisarm() override;
  bool Silent() const;
  void StartPump();
  Duration UntilLook() const;
  void Pump();
  // Takes what is there. An error means that the stream is over.
  absl::Status TakeAll(VideoDevice::Readiness readiness);
  absl::Status OnFrame(const V4l2Link::Taken& taken);
  absl::Status Deliver(const V4l2Link::Taken& taken, const FrameStamp& stamp, uint64_t sequence);
  // The stream has ended by itself, or the camera is gone.
  void OnTrouble(const absl::Status& trouble);
  ExposureTiming Timing() const;
  Duration PossibleExposure() const;
  bool stretches() const { return options_.leave_automatic.count("dynamic_frame_rate") > 0; }

  VideoSystem& system_;
  const V4l2Options options_;
  V4l2Capabilities capabilities_;
  Waker waker_;

  // The device's thread only, once it runs.
  std::unique_ptr<V4l2Link> link_;
  bool configured_ = false;
  bool pumping_ = false;
  std::shared_ptr<CameraShot> active_;  // triggered, its frame not yet seen
  FrameChoice choice_;                  // of active_
  FrameCounter counter_;
  uint64_t skipped_ = 0;    // frames that never came, since the last one delivered
  int frames_ = 0;          // of this stream
  TimePoint last_frame_{};  // dequeued, or the stream's start
  TimePoint last_empty_{};  // when no frame was waiting
  std::optional<TimePoint> last_stamp_;
  Duration measured_interval_{};
  // An exposure shows only some frames after it was set; until then frames may still have the last one.
  bool settled_ = false;
  TimePoint controls_set_{};
  Duration used_exposure_{};       // last one set
  Duration unsettled_exposure_{};  // longest one that frames may have while it is not settled

  std::atomic<bool> lost_{false};
  std::atomic<int64_t> interval_ns_{0};  // as configured
};

}  // namespace lightstage
