// The Camera contract over one AravisLink. A thread of its own owns the link and makes all its blocking calls; deadlines fire on
// the rig's clock, so that a camera that does not answer never holds up a caller.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "drivers/aravis/link.h"
#include "drivers/link/streaming_camera.h"

namespace lightstage {

class AravisCamera final : public StreamingCamera {
 public:
  static absl::StatusOr<std::unique_ptr<Camera>> Open(const AravisOptions& options,
                                                      const DeviceContext& context);
  // Also waits for a libaravis call in progress: up to some seconds if the camera does not answer.
  ~AravisCamera() override;

  ConfigResult Validate(const CameraConfig& config) const override {
    return capabilities_.Validate(config);
  }
  ExposureResult ValidateExposure(Duration exposure) const override {
    return capabilities_.ValidateExposure(exposure);
  }

 private:
  AravisCamera(const AravisOptions& options, const DeviceContext& context);
  absl::StatusOr<std::unique_ptr<AravisLink>> Connect();

  // ---- Any thread.
  void OnLost(const std::string& why);
  bool lost() const;
  absl::Status LostError() const;

  // ---- The device's thread.
  // After control was lost these connect anew, to the same camera, Arm with the configuration that it had.
  absl::Status ConnectAnew();
  // `link` if it is to the camera that was opened first.
  absl::StatusOr<std::unique_ptr<AravisLink>> TheSame(std::unique_ptr<AravisLink> link) const;
  absl::Status DoConfigure(const CameraConfig& config) override;
  absl::Status DoArm(const Outstanding& operation, TimePoint deadline) override;
  absl::Status StartStream(TimePoint deadline);
  void DoTrigger(const std::shared_ptr<CameraShot>& shot) override;
  void DoDisarm() override;
  void OnFirstPacket(uint64_t session, TimePoint time);
  void OnExposureEnded(uint64_t frame_id, TimePoint time);
  void OnBuffer(uint64_t session);
  void FinishActive(AravisLink::Taken taken);
  // Whether the exposure can be over at `time`.
  static bool CanBeOver(const CameraShot& shot, TimePoint time);

  const AravisOptions options_;
  AravisCapabilities capabilities_;

  // The device's thread only, once it runs.
  std::unique_ptr<AravisLink> link_;
  std::optional<CameraConfig> asked_;  // the last configuration
  bool configured_ = false;            // with it
  bool streaming_ = false;
  bool out_of_step_ =
      false;  // a frame came or stayed away that nobody can tell: start the stream anew
  std::shared_ptr<CameraShot> active_;  // triggered, its frame not yet seen
  std::optional<TimePoint> told_end_;   // when the camera said that its exposure was over
  uint64_t sequence_base_ = 0;          // frames counted before the last reconnection
  uint64_t last_sequence_ = 0;

  mutable Mutex lost_mutex_;
  std::string lost_ ABSL_GUARDED_BY(lost_mutex_);  // why; empty if it is not
};

}  // namespace lightstage
