// A simulated turntable or gantry: trapezoidal motion, settling with a decaying shake.
#pragma once

#include <atomic>
#include <memory>

#include "drivers/api/axis.h"
#include "sim/rig/device_operations.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

struct SimAxisOptions {
  AxisRole role = AxisRole::kTurntable;
  Angle min, max;
  bool continuous = false;
  double max_velocity_dps = 0;
  AxisMechanics mechanics;
};

class SimAxis final : public Axis {
 public:
  SimAxis(const std::string& name, const SimAxisOptions& options, std::shared_ptr<World> world);
  ~SimAxis() override;

  const AxisInfo& info() const override { return info_; }
  void Home(TimePoint deadline, Completion<AxisState> done) override;
  void Move(Angle target, double velocity_dps, TimePoint deadline,
            Completion<AxisState> done) override;
  void Turn(double velocity_dps, TimePoint deadline, Completion<AxisState> done) override;
  void Read(TimePoint deadline, Completion<AxisState> done) override;
  void Stop(TimePoint deadline, Completion<AxisState> done) override;

 private:
  AxisState State() const;
  absl::Status CheckHomed() const;
  // AXIS_BUSY while it moves; else the state from which a motion can start.
  absl::StatusOr<AxisState> AtRest() const;
  // Starts the way to `target` and returns when it will have settled; kNever if it is to stall. AXIS_BUSY while it moves.
  absl::StatusOr<TimePoint> Go(Angle target, double velocity_dps, bool stall);
  // Starts braking if it moves; returns when it stands.
  TimePoint BrakeNow();

  const SimAxisOptions options_;
  const AxisInfo info_;
  const std::shared_ptr<World> world_;  // shared: all devices of a rig are in one world
  std::atomic<bool> homed_{false};
  DeviceTimers timers_;
  DeviceOperations<AxisState> operations_;
};

}  // namespace lightstage::sim
