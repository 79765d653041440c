#include "daemon/capture/projector_4d.h"

#include <algorithm>

#include "daemon/capture/fixed_program.h"

namespace lightstage {
namespace {

// Which entries of the outer and the inner list position `index` has: the inner one is gone through
// forth and back.
struct Visit {
  uint64_t outer, inner;
};

Visit Serpentine(uint64_t index, uint64_t inner_count) {
  Visit visit{index / inner_count, index % inner_count};
  if (visit.outer % 2 == 1) visit.inner = inner_count - 1 - visit.inner;
  return visit;
}

Pose PositionAt(const Projector4dPlan& plan, AxisOrder order, uint64_t position) {
  if (order == AxisOrder::kAzimuthOutside) {
    Visit visit = Serpentine(position, plan.tilts.size());
    return {plan.azimuths[visit.outer], plan.tilts[visit.inner]};
  }
  Visit visit = Serpentine(position, plan.azimuths.size());
  return {plan.azimuths[visit.inner], plan.tilts[visit.outer]};
}

class Projector4dShots final : public BasisShots {
 public:
  explicit Projector4dShots(const Projector4dPlan& plan)
      : plan_(plan), patterns_(PatternsPerPosition(plan)) {}

  uint64_t size() const override {
    return uint64_t{plan_.tilts.size()} * plan_.azimuths.size() * patterns_;
  }
  Pose PoseOf(uint64_t index) const override {
    return PositionAt(plan_, plan_.order, index / patterns_);
  }
  Condition ConditionOf(uint64_t index) const override {
    return {{}, PatternAt(static_cast<int>(index % patterns_))};
  }
  Condition Reference() const override {
    return {{}, Pattern{PatternArrangement::kFull, plan_.profile, plan_.grid}};
  }

 private:
  Pattern PatternAt(int index) const {
    Pattern pattern;
    pattern.profile = plan_.profile;
    pattern.grid = plan_.grid;
    if (!plan_.influence) {
      pattern.arrangement = PatternArrangement::kSquare;
      pattern.row = index / plan_.grid;
      pattern.column = index % plan_.grid;
      return pattern;
    }
    int offsets = *plan_.influence + 1;
    int horizontal = plan_.grid * offsets;
    pattern.influence = *plan_.influence;
    if (index < horizontal) {
      pattern.arrangement = PatternArrangement::kHorizontal;
      pattern.row = index / offsets;
      pattern.column = index % offsets;
    } else {
      pattern.arrangement = PatternArrangement::kVertical;
      pattern.column = (index - horizontal) / offsets;
      pattern.row = (index - horizontal) % offsets;
    }
    return pattern;
  }

  const Projector4dPlan plan_;
  const uint64_t patterns_;
};

Duration TimeMoving(const Projector4dPlan& plan, AxisOrder order, const AxisInfo* turntable,
                    const AxisInfo* tilt) {
  Duration total{};
  uint64_t positions = uint64_t{plan.tilts.size()} * plan.azimuths.size();
  for (uint64_t i = 1; i < positions; ++i) {
    Pose from = PositionAt(plan, order, i - 1), to = PositionAt(plan, order, i);
    Duration azimuth =
        turntable ? MoveDuration(*turntable, from.azimuth, to.azimuth) : Duration::zero();
    Duration gantry = tilt ? MoveDuration(*tilt, from.tilt, to.tilt) : Duration::zero();
    total += std::max(azimuth, gantry);
  }
  return total;
}

}  // namespace

std::unique_ptr<Program> Projector4dProgram(const CommonPlan& common, const Projector4dPlan& plan) {
  return FixedProgram(common, std::make_unique<Projector4dShots>(plan));
}

uint64_t PatternsPerPosition(const Projector4dPlan& plan) {
  uint64_t m = static_cast<uint64_t>(plan.grid);
  return plan.influence ? 2 * m * (static_cast<uint64_t>(*plan.influence) + 1) : m * m;
}

AxisOrder FastestOrder(const Projector4dPlan& plan, const AxisInfo* turntable,
                       const AxisInfo* tilt) {
  Duration tilt_outside = TimeMoving(plan, AxisOrder::kTiltOutside, turntable, tilt);
  Duration azimuth_outside = TimeMoving(plan, AxisOrder::kAzimuthOutside, turntable, tilt);
  return azimuth_outside < tilt_outside ? AxisOrder::kAzimuthOutside : AxisOrder::kTiltOutside;
}

}  // namespace lightstage
