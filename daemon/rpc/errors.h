// The one place where absl::Status becomes gRPC's: code and message as they are, and exactly one google.rpc.ErrorInfo with reason,
// domain "lightstaged" and metadata (AIP-193).
#pragma once

#include "absl/status/status.h"
#include "grpcpp/support/status.h"
#include "lightstage/v1/types.pb.h"

namespace lightstage::rpc {

grpc::Status ToGrpc(const absl::Status& status);

// The same three things inside a message.
v1::Reason ToReason(const absl::Status& status);

}  // namespace lightstage::rpc
