// What the rig may be asked for. Every shot passes here before anything moves, whatever program
// made it, and so does every manual command.
//
// Errors are INVALID_ARGUMENT and name the thing, its value and what would be right. Reasons:
// ANGLE_NOT_FINITE, AZIMUTH_LIMIT, TILT_LIMIT (the rig file's limits), AXIS_LIMIT (the device's),
// AXIS_MISSING; LAMPS_MISSING, LAMP_UNKNOWN, LAMP_DUPLICATE, LAMP_LEVEL, LAMPS_ON_LIMIT;
// PROJECTOR_MISSING, PATTERN_INVALID, GRID_TOO_FINE; EXPOSURES_EMPTY, EXPOSURES_NOT_ASCENDING,
// EXPOSURES_TOO_MANY, EXPOSURE_LIMIT (the rig file's), CAMERA_EXPOSURE (the camera's).
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "daemon/capture/rig_facts.h"
#include "dataset/shot.h"

namespace lightstage {

absl::Status CheckPose(const Pose& pose, const RigFacts& facts);
absl::Status CheckCondition(const Condition& condition, const RigFacts& facts);
// A bracket: at least one, strictly ascending, each > 0. What the camera would adjust passes:
// ResolvePlan() adjusts beforehand.
absl::Status CheckExposures(const std::vector<Duration>& exposures, const RigFacts& facts);

// All three, naming the shot.
absl::Status CheckShot(const Shot& shot, const RigFacts& facts);

}  // namespace lightstage
