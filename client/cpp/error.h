// What a call ended with, as an error of base/status.h.
#pragma once

#include <string_view>

#include "absl/status/status.h"
#include "grpcpp/support/status.h"

namespace lightstage::client {

// Reasons that the client itself gives. All others are the daemon's.
inline constexpr std::string_view kCannotConnect = "CANNOT_CONNECT";    // nobody answers there
inline constexpr std::string_view kConnectionLost = "CONNECTION_LOST";  // it broke during a call
inline constexpr std::string_view kNoAnswer = "NO_ANSWER";              // a call's deadline passed
inline constexpr std::string_view kCancelled = "CLIENT_CANCELLED";      // by this process

// The daemon's google.rpc.ErrorInfo gives reason and metadata. A status without one comes from the
// transport: then the reason is kConnectionLost, kNoAnswer or the code's name.
absl::Status FromGrpc(const grpc::Status& status);

// True if the same call may succeed on a new connection.
bool IsConnectionLost(const absl::Status& status);

}  // namespace lightstage::client
