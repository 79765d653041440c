// One camera behind its node, as blocking calls: configuration, controls, mapped buffers. All methods belong to one thread. Errors:
// UNAVAILABLE / DEVICE_LOST, FAILED_PRECONDITION / DEVICE_BUSY, DEVICE_FAULT, CONTROL_REFUSED, CONTROL_AUTOMATIC.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/v4l2/capabilities.h"
#include "drivers/v4l2/free_running.h"
#include "drivers/v4l2/video_port.h"

namespace lightstage {

class V4l2Link {
 public:
  // Finds the camera that `options` name (and, if given, that is `same`), turns off what is automatic and learns what it can do.
  // NOT_FOUND / DEVICE_NOT_FOUND; FAILED_PRECONDITION / DEVICE_UNSUITABLE.
  static absl::StatusOr<std::unique_ptr<V4l2Link>> Open(VideoSystem& system,
                                                        const V4l2Options& options,
                                                        const std::string& name,
                                                        const VideoDescription* same);
  // Ends the stream, gives its memory back and closes the node, even if the camera is gone.
  ~V4l2Link();
  V4l2Link(const V4l2Link&) = delete;
  V4l2Link& operator=(const V4l2Link&) = delete;

  const V4l2Capabilities& capabilities() const { return capabilities_; }

  // Applies a valid configuration and reads it back. Not while streaming.
  absl::StatusOr<CameraConfig> Configure(const CameraConfig& config);
  // Between frames, as configured; 0 if the camera does not tell.
  Duration interval() const { return interval_; }

  absl::Status StartStream();
  void StopStream();  // best effort
  bool streaming() const { return !buffers_.empty(); }

  // Costs nothing if it is already set; else `*changed` becomes true.
  absl::StatusOr<Duration> SetExposure(Duration exposure, bool* changed);

  VideoDevice::Readiness Wait(Duration timeout, int wake_fd) {
    return port_.device().Wait(timeout, wake_fd);
  }

  // A buffer with a frame; to be given back.
  struct Taken {
    uint32_t index = 0;
    uint32_t sequence = 0;
    std::optional<TimePoint> stamp;
    bool flagged_start_of_exposure = false;
    bool damaged = false;  // V4L2_BUF_FLAG_ERROR
    std::span<const std::byte> bytes;
    int64_t stamp_ns = 0;  // whatever its clock
  };
  // The next one; nothing if there is none yet.
  absl::StatusOr<std::optional<Taken>> Take();
  absl::Status GiveBack(const Taken& taken);
  // Its picture. DATA_LOSS / FRAME_INCOMPLETE; exposure, its times and the sequence are left to the caller.
  absl::StatusOr<Frame> Decode(const Taken& taken) const;

 private:
  V4l2Link(VideoPort port, const V4l2Options& options);

  absl::Status Learn(VideoDescription description);
  absl::Status LearnExposure();
  absl::Status LearnGain();
  void LearnCropping();
  void LearnSmallestRegion();
  absl::Status Prepare();
  absl::Status SetFormat(const VideoFormat& video, int width, int height);
  absl::Status SetRegion(const VideoFormat& video, int width, int height);
  absl::Status Crop(int width, int height);
  absl::Status Compose(int width, int height);
  absl::Status SetInterval();
  absl::Status MapBuffers();

  const VideoPort port_;
  const V4l2Options options_;
  const VideoControls controls_;
  V4l2Capabilities capabilities_;

  CameraConfig config_;
  VideoFormat video_;
  size_t bytes_per_line_ = 0;
  YuvRange yuv_range_ = YuvRange::kLimited;
  Duration interval_{};
  std::optional<int64_t> exposure_code_;  // last one set, if it is still there
  std::vector<std::span<std::byte>> buffers_;
  bool owns_buffers_ = false;  // the kernel's, which may not have been mapped yet
};

}  // namespace lightstage
