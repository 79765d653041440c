// Devices that do nothing and are done at once: every operation completes before its call returns.
// For the engine's benchmark and tests, where only the engine's own work should be seen. They keep
// every rule of drivers/api; a Set or Move is instantly there.
//
// Threads: Stop, Dark, Black, Disarm and Refresh may be called from any thread.
#pragma once

#include <atomic>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "drivers/api/axis.h"
#include "drivers/api/camera.h"
#include "drivers/api/lamps.h"
#include "drivers/api/projector.h"

namespace lightstage {

// Delivers frames of zeros. Every whole size up to the sensor's is valid; so is any exposure from 1
// ns to 1 h, which takes no time.
class NullCamera final : public Camera {
 public:
  NullCamera(Clock& clock, int width, int height);
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
  Clock& clock_;
  CameraInfo info_;
  std::atomic<bool> armed_{false};
  Mutex mutex_;
  CameraConfig config_ ABSL_GUARDED_BY(mutex_);
  uint64_t sequence_ = 0;  // caller's thread only
};

class NullAxis final : public Axis {
 public:
  explicit NullAxis(AxisInfo info);
  const AxisInfo& info() const override { return info_; }
  void Home(TimePoint deadline, Completion<AxisState> done) override;
  void Move(Angle target, double velocity_dps, TimePoint deadline,
            Completion<AxisState> done) override;
  // Arrives wherever it is told to at once, so it cannot turn.
  void Turn(double velocity_dps, TimePoint deadline, Completion<AxisState> done) override;
  void Read(TimePoint deadline, Completion<AxisState> done) override;
  void Stop(TimePoint deadline, Completion<AxisState> done) override;

 private:
  AxisState State() const;
  const AxisInfo info_;
  mutable Mutex mutex_;
  AxisState state_ ABSL_GUARDED_BY(mutex_);
};

// Continuous levels, no time-to-dark.
class NullLamps final : public Lamps {
 public:
  explicit NullLamps(int count);
  const LampsInfo& info() const override { return info_; }
  void Set(const std::vector<float>& levels, TimePoint deadline,
           Completion<LampsState> done) override;
  void Dark(TimePoint deadline, Completion<LampsState> done) override;
  absl::Status SetTimeToDark(Duration time) override;
  absl::Status Refresh() override { return absl::OkStatus(); }

 private:
  LampsInfo info_;
};

class NullProjector final : public Projector {
 public:
  NullProjector(int width, int height);
  const ProjectorInfo& info() const override { return info_; }
  void Show(const Pattern& pattern, TimePoint deadline, Completion<ProjectorState> done) override;
  void Black(TimePoint deadline, Completion<ProjectorState> done) override;

 private:
  ProjectorInfo info_;
};

}  // namespace lightstage
