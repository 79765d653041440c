// API messages as JSON, in protobuf's canonical form.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "google/protobuf/message.h"
#include "lightstage/v1/plan.pb.h"

namespace lightstage::client {

// One line with its end. Fields at their default are written too, so that a script finds every key;
// `optional` ones that are absent are not. INTERNAL / JSON_FAILED if the message cannot be written
// so, e.g. for a time beyond year 9999.
absl::StatusOr<std::string> ToJsonLine(const google::protobuf::Message& message);

// INVALID_ARGUMENT / USAGE with what is wrong, also for an unknown field.
absl::StatusOr<v1::Plan> PlanFromJson(const std::string& json);

}  // namespace lightstage::client
