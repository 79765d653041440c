// A simulated projector: shows what it is told, after the time its panel takes to change.
#pragma once

#include <memory>

#include "drivers/api/projector.h"
#include "sim/rig/device_operations.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

struct SimProjectorOptions {
  Duration settle{};  // until the driver confirms
  Duration
      latency{};  // of the video chain: so long the old image stays, then it fades into the new one until `settle`
};

class SimProjector final : public Projector {
 public:
  SimProjector(const std::string& name, const SimProjectorOptions& options,
               std::shared_ptr<World> world);
  ~SimProjector() override;

  const ProjectorInfo& info() const override { return info_; }
  void Show(const Pattern& pattern, TimePoint deadline, Completion<ProjectorState> done) override;
  void Black(TimePoint deadline, Completion<ProjectorState> done) override;

 private:
  // Tells the world; when the driver confirms.
  TimePoint Change(const Pattern& pattern);

  const ProjectorInfo info_;
  const Duration latency_;
  const std::shared_ptr<World> world_;  // shared: all devices of a rig are in one world
  DeviceTimers timers_;
  DeviceOperations<ProjectorState> operations_;
};

}  // namespace lightstage::sim
