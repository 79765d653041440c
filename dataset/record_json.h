// Shots and their records as JSON: one form for the journal, the manifest and the images' own attributes (docs/DATASET.md).
//
// Angles are in degrees, exposures in µs (exact to the ns), rig and device clocks in ns. Reading is strict (dataset/json_reader.h).
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "dataset/json_reader.h"
#include "dataset/shot.h"
#include "optics/rig_geometry.h"

namespace lightstage {

Json ToJson(const Pose& pose);
Json ToJson(const Condition& condition);
Json ToJson(const ShotRecord& record);
Json ToJson(const RigGeometry& geometry);
Json ToJson(const Vec3& v);

// Errors are recorded in the reader.
Pose ReadPose(const JsonReader& reader);
Condition ReadCondition(const JsonReader& reader);
ShotRecord ReadShotRecord(const JsonReader& reader);
RigGeometry ReadRigGeometry(const JsonReader& reader);

absl::StatusOr<Condition> ConditionFromJson(std::string_view text, std::string name);

}  // namespace lightstage
