// The light stage: every lamp of the brace alone, at every azimuth of the turntable.
#pragma once

#include <memory>

#include "daemon/capture/program.h"

namespace lightstage {

// The plan must be resolved (daemon/capture/check_plan.h).
std::unique_ptr<Program> LightStageProgram(const CommonPlan& common, const LightStagePlan& plan);

}  // namespace lightstage
