// 4D illumination: a set of projector patterns at every position of the projector around the
// object.
#pragma once

#include <memory>

#include "absl/types/span.h"
#include "daemon/capture/program.h"
#include "drivers/api/axis.h"

namespace lightstage {

// The plan must be resolved (daemon/capture/check_plan.h). At each position come the m² squares in
// order of row, then column; or the horizontal patterns in order of row, then offset, and after
// them the vertical ones in order of column, then offset.
std::unique_ptr<Program> Projector4dProgram(const CommonPlan& common, const Projector4dPlan& plan);

// Patterns shown at each position.
uint64_t PatternsPerPosition(const Projector4dPlan& plan);

// The order that spends less time moving between positions; kTiltOutside if both take as long. A
// missing axis does not move.
AxisOrder FastestOrder(const Projector4dPlan& plan, const AxisInfo* turntable,
                       const AxisInfo* tilt);

}  // namespace lightstage
