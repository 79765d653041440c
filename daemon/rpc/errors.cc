#include "daemon/rpc/errors.h"

#include "base/status.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace lightstage::rpc {

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  google::rpc::ErrorInfo info;
  info.set_reason(ErrorReason(status));
  info.set_domain("lightstaged");
  for (const auto& [key, value] : ErrorMetadataOf(status)) (*info.mutable_metadata())[key] = value;
  google::rpc::Status details;
  details.set_code(static_cast<int>(status.code()));
  details.set_message(MessageOf(status));
  details.add_details()->PackFrom(info);
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), MessageOf(status),
                      details.SerializeAsString());
}

v1::Reason ToReason(const absl::Status& status) {
  v1::Reason reason;
  reason.set_reason(ErrorReason(status));
  reason.set_message(MessageOf(status));
  for (const auto& [key, value] : ErrorMetadataOf(status))
    (*reason.mutable_metadata())[key] = value;
  return reason;
}

}  // namespace lightstage::rpc
