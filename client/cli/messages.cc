#include "client/cli/messages.h"

#include "base/status.h"
#include "base/strings.h"
#include "client/cli/values.h"
#include "google/protobuf/util/json_util.h"

namespace lightstage::client {

absl::StatusOr<std::string> ToJsonLine(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  std::string json;
  auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
  if (!status.ok()) {
    return Error(absl::StatusCode::kInternal, "JSON_FAILED",
                 absl::StrCat(message.GetTypeName(), " has no JSON form: ", status.ToString()),
                 {{"message", message.GetTypeName()}});
  }
  return json + "\n";
}

absl::StatusOr<v1::Plan> PlanFromJson(const std::string& json) {
  v1::Plan plan;
  auto status = google::protobuf::util::JsonStringToMessage(json, &plan);
  if (!status.ok()) {
    return UsageError("not the JSON form of a lightstage.v1.Plan: " + status.ToString());
  }
  return plan;
}

}  // namespace lightstage::client
