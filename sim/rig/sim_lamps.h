// The simulated lamps of a brace.
#pragma once

#include <memory>
#include <vector>

#include "drivers/api/lamps.h"
#include "sim/rig/device_operations.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

struct SimLampsOptions {
  int steps = 0;            // 0: continuous
  Duration settle{};        // until the driver confirms
  Duration rise{}, fall{};  // what the light really takes
  Duration max_time_to_dark{};
};

class SimLamps final : public Lamps {
 public:
  SimLamps(const std::string& name, const SimLampsOptions& options, std::shared_ptr<World> world);
  ~SimLamps() override;

  const LampsInfo& info() const override { return info_; }
  void Set(const std::vector<float>& levels, TimePoint deadline,
           Completion<LampsState> done) override;
  void Dark(TimePoint deadline, Completion<LampsState> done) override;
  absl::Status SetTimeToDark(Duration time) override;
  absl::Status Refresh() override;

 private:
  void Restart() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void TimeIsUp();

  const LampsInfo info_;
  const Duration rise_, fall_;
  const std::shared_ptr<World> world_;  // shared: all devices of a rig are in one world
  DeviceTimers timers_;
  DeviceOperations<LampsState> operations_;
  Mutex mutex_;
  Duration time_to_dark_ ABSL_GUARDED_BY(mutex_){};  // 0: never
  TimePoint dark_at_ ABSL_GUARDED_BY(mutex_) = kNever;
  bool timer_set_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace lightstage::sim
