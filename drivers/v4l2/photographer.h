// Drives a camera in the tests: every operation waits for its end.
#pragma once

#include <memory>

#include "drivers/api/camera.h"

namespace lightstage {

class Photographer {
 public:
  Photographer(Clock& clock, Camera& camera) : clock_(clock), camera_(camera) {}

  absl::StatusOr<CameraConfig> Configure(const CameraConfig& config) {
    return Do([&](TimePoint deadline, Completion<CameraConfig> done) {
      camera_.Configure(config, deadline, std::move(done));
    });
  }
  absl::StatusOr<CameraConfig> Arm(Duration patience = kPatience) {
    return Do([&](TimePoint deadline,
                  Completion<CameraConfig> done) { camera_.Arm(deadline, std::move(done)); },
              patience);
  }
  absl::StatusOr<CameraConfig> Disarm() {
    return Do([&](TimePoint deadline, Completion<CameraConfig> done) {
      camera_.Disarm(deadline, std::move(done));
    });
  }
  absl::Status Ready(const CameraConfig& config) {
    RETURN_IF_ERROR(Configure(config).status());
    return Arm().status();
  }
  // The frame; what must hold once its exposure has ended goes into `then`.
  absl::StatusOr<Frame> Take(Duration exposure, Duration patience = kPatience,
                             std::function<void()> then = {}) {
    Pending<Frame> frame(clock_);
    camera_.Trigger(
        exposure, clock_.Now() + patience,
        [then = std::move(then)](absl::StatusOr<ExposureEnd>) {
          if (then) then();
        },
        frame.sink());
    return frame.Wait(clock_.Now() + patience + kPatience, "the frame");
  }

 private:
  static constexpr Duration kPatience = std::chrono::seconds(20);

  template <class Call>
  absl::StatusOr<CameraConfig> Do(Call call, Duration patience = kPatience) {
    Pending<CameraConfig> done(clock_);
    call(clock_.Now() + patience, done.sink());
    return done.Wait(clock_.Now() + patience + kPatience, "the operation");
  }

  Clock& clock_;
  Camera& camera_;
};

}  // namespace lightstage
