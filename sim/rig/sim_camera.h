// A simulated camera: exposes the world as it is, on the rig's clock.
//
// On virtual time a frame is computed inside the clock's callback, while time stands still. On real time a thread of its own
// computes it, so that the clock's thread is never held up and exposure_ended is called on time; frame_ready then comes when the
// readout has ended and the picture is computed, whichever is later.
#pragma once

#include <memory>
#include <optional>
#include <thread>

#include "base/queue.h"
#include "drivers/api/camera.h"
#include "sim/rig/device_timers.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

struct SimCameraOptions {
  int width = 0, height = 0;  // the chip, even
  int bits = 0;               // its depth, [9, 16]
  Duration readout{};
  Duration min_exposure{}, max_exposure{};
  double max_gain_db = 0;
};

class SimCamera final : public Camera {
 public:
  SimCamera(const std::string& name, const SimCameraOptions& options, std::shared_ptr<World> world);
  ~SimCamera() override;

  const CameraInfo& info() const override { return info_; }
  ConfigResult Validate(const CameraConfig& config) const override;
  ExposureResult ValidateExposure(Duration exposure) const override;
  void Configure(const CameraConfig& config, TimePoint deadline,
                 Completion<CameraConfig> done) override;
  void Arm(TimePoint deadline, Completion<CameraConfig> done) override;
  void Trigger(Duration exposure, TimePoint deadline, Completion<ExposureEnd> exposure_ended,
               Completion<Frame> frame_ready) override;
  void Disarm(TimePoint deadline, Completion<CameraConfig> done) override;

 private:
  // The exposure in progress.
  struct Shot {
    uint64_t number = 0;
    TimePoint start{}, end{};
    CameraConfig config;
    Completion<ExposureEnd> ended;  // empty once called
    Completion<Frame> ready;
    std::vector<uint64_t> timers;
    bool read_out = false;
    std::optional<absl::StatusOr<Frame>> frame;
  };

  void ExposureEnded(uint64_t number);
  void ReadOut(uint64_t number);
  // Computes the frame; on the worker's thread if there is one.
  void Compute(uint64_t number);
  void DeliverIfComplete(uint64_t number);
  // Ends the shot in progress, if it is still number `number` (0: any), with an error for all that was not called yet.
  void Abort(uint64_t number, const absl::Status& why);
  absl::StatusOr<Frame> TakePicture(const CameraConfig& config, TimePoint start, TimePoint end,
                                    uint64_t number);
  FilmSize chip() const { return {options_.width, options_.height}; }

  const SimCameraOptions options_;
  const CameraInfo info_;
  const std::shared_ptr<World> world_;  // shared: all devices of a rig are in one world
  const TimePoint opened_;
  DeviceTimers timers_;

  Mutex mutex_;
  CameraConfig config_ ABSL_GUARDED_BY(mutex_);
  bool armed_ ABSL_GUARDED_BY(mutex_) = false;
  uint64_t shots_ ABSL_GUARDED_BY(mutex_) = 0;
  std::optional<Shot> shot_ ABSL_GUARDED_BY(mutex_);

  BoundedQueue<absl::AnyInvocable<void() &&>> work_{64};
  std::thread worker_;  // real time only
};

}  // namespace lightstage::sim
