#include "daemon/rpc/errors.h"

#include "base/status.h"
#include "base/utf8.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace lightstage::rpc {

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  google::rpc::ErrorInfo info;
  info.set_reason(ErrorReason(status));
  info.set_domain("lightstaged");
  for (const auto& [key, value] : ErrorMetadataOf(status))
    (*info.mutable_metadata())[CleanUtf8(key)] = CleanUtf8(value);
  google::rpc::Status details;
  details.set_code(static_cast<int>(status.code()));
  details.set_message(CleanUtf8(MessageOf(status)));
  details.add_details()->PackFrom(info);
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), details.message(),
                      details.SerializeAsString());
}

v1::Reason ToReason(const absl::Status& status) {
  v1::Reason reason;
  reason.set_reason(ErrorReason(status));
  reason.set_message(CleanUtf8(MessageOf(status)));
  for (const auto& [key, value] : ErrorMetadataOf(status))
    (*reason.mutable_metadata())[CleanUtf8(key)] = CleanUtf8(value);
  return reason;
}

}  // namespace lightstage::rpc
