// Between messages and our types: the only such place. From a message: INVALID_ARGUMENT naming the field, its value and what would
// be right; what a value means for this rig is checked elsewhere (daemon/capture).
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/capture/plan.h"
#include "dataset/shot.h"
#include "drivers/api/axis.h"
#include "lightstage/v1/plan.pb.h"
#include "lightstage/v1/rig.pb.h"
#include "lightstage/v1/run.pb.h"

namespace lightstage::rpc {

// `lamp_count`: what "all lamps" means.
absl::StatusOr<Plan> FromMessage(const v1::Plan& message, int lamp_count);
absl::StatusOr<Pattern> FromMessage(const v1::Pattern& message);
absl::StatusOr<std::vector<Duration>> ExposuresFromMessage(
    const google::protobuf::RepeatedField<double>& exposures_us);

// Every angle and exposure written out: FromMessage() gives back the same plan on any rig.
v1::Plan ToMessage(const Plan& plan);
v1::Pattern ToMessage(const Pattern& pattern);
v1::Pose ToMessage(const Pose& pose);
v1::Vector ToMessage(const Vec3& v);
v1::Shot ToMessage(const ShotRecord& record);
void AddExposures(const std::vector<ExposureRecord>& exposures,
                  google::protobuf::RepeatedPtrField<v1::Exposure>* messages);
google::protobuf::Timestamp ToMessage(WallTime t);

// The canonical JSON of a plan, as stored with a run, and back.
absl::StatusOr<std::string> PlanToJson(const Plan& plan);
absl::StatusOr<Plan> PlanFromJson(const std::string& json, int lamp_count);

}  // namespace lightstage::rpc
