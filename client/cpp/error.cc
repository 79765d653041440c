#include "client/cpp/error.h"

#include <algorithm>
#include <string>

#include "absl/strings/match.h"
#include "base/status.h"
#include "base/strings.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace lightstage::client {
namespace {

// The first ErrorInfo among the details. gRPC hands over "grpc-status-details-bin" as
// error_details().
bool FindErrorInfo(const grpc::Status& status, google::rpc::ErrorInfo* info) {
  google::rpc::Status details;
  if (status.error_details().empty() || !details.ParseFromString(status.error_details())) {
    return false;
  }
  for (const auto& detail : details.details()) {
    if (detail.UnpackTo(info) && !info->reason().empty()) return true;
  }
  return false;
}

}  // namespace

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  // gRPC's codes are absl's by number.
  auto code = static_cast<absl::StatusCode>(status.error_code());
  google::rpc::ErrorInfo info;
  if (FindErrorInfo(status, &info)) {
    ErrorMetadata metadata(info.metadata().begin(), info.metadata().end());
    std::sort(metadata.begin(), metadata.end());
    return Error(code, info.reason(), status.error_message(), metadata);
  }
  switch (code) {
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kCancelled:  // a daemon that goes down ends its calls so
      return Error(absl::StatusCode::kUnavailable, kConnectionLost,
                   absl::StrCat("connection lost: ", status.error_message()));
    case absl::StatusCode::kDeadlineExceeded:
      return Error(code, kNoAnswer, "the daemon did not answer in time");
    default:
      if (absl::StrContains(status.error_message(), "Stream removed")) {
        return Error(absl::StatusCode::kUnavailable, kConnectionLost,
                     absl::StrCat("connection lost: ", status.error_message()));
      }
      return absl::Status(code, status.error_message());
  }
}

bool IsConnectionLost(const absl::Status& status) {
  return !status.ok() && ErrorReason(status) == kConnectionLost;
}

}  // namespace lightstage::client
