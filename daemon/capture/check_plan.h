// Before a plan runs: is it possible on this rig, and what exactly does it mean there?
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/capture/plan.h"
#include "daemon/capture/rig_facts.h"

namespace lightstage {

// More than fit any disk; keeps a slip of the keyboard from counting for hours.
constexpr uint64_t kMaxBasisShots = 1'000'000;

struct ResolvedPlan {
  // Nothing left open: exposures as the camera will really use them, axis order, parked tilt. This,
  // not what the user typed, belongs into a run's journal: its program follows from it alone,
  // whatever becomes of the rig file's defaults.
  Plan plan;
  // What the user should know, one line each: adjusted exposures, a set that a cheaper one could
  // replace.
  std::vector<std::string> notes;
};

// Touches no device. INVALID_ARGUMENT with the reasons of daemon/capture/limits.h, and:
// AZIMUTHS_EMPTY, TILTS_EMPTY, LAMPS_EMPTY, AZIMUTH_DUPLICATE (also 360° apart), TILT_DUPLICATE,
// FRAME_INTERVAL, PLAN_TOO_LARGE. Resolving a resolved plan changes nothing.
absl::StatusOr<ResolvedPlan> ResolvePlan(const Plan& plan, const RigFacts& facts);

}  // namespace lightstage
