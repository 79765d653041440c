#include "daemon/capture/light_stage.h"

#include "daemon/capture/fixed_program.h"

namespace lightstage {
namespace {

class LightStageShots final : public BasisShots {
 public:
  explicit LightStageShots(const LightStagePlan& plan) : plan_(plan) {}

  uint64_t size() const override { return uint64_t{plan_.azimuths.size()} * plan_.lamps.size(); }
  Pose PoseOf(uint64_t index) const override {
    return {plan_.azimuths[index / plan_.lamps.size()], plan_.tilt.value_or(Degrees(0))};
  }
  Condition ConditionOf(uint64_t index) const override {
    return {{{plan_.lamps[index % plan_.lamps.size()], plan_.level}}, {}};
  }
  Condition Reference() const override {
    Condition all;
    for (int lamp : plan_.lamps) all.lamps.push_back({lamp, plan_.level});
    return all;
  }

 private:
  const LightStagePlan plan_;
};

}  // namespace

std::unique_ptr<Program> LightStageProgram(const CommonPlan& common, const LightStagePlan& plan) {
  return FixedProgram(common, std::make_unique<LightStageShots>(plan));
}

}  // namespace lightstage
