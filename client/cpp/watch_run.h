// Follows a run to its end, through broken connections.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "client/cpp/canceller.h"
#include "client/cpp/connection.h"
#include "client/cpp/retry.h"
#include "lightstage/v1/run.pb.h"

namespace lightstage::client {

// True for SUCCEEDED, FAILED and CANCELLED, and for INTERRUPTED: nothing will change unless somebody
// resumes the run.
bool HasEnded(v1::RunState state);

struct WatchOptions {
  // Every stored shot too, from this many on. Each is seen exactly once, however often the
  // connection breaks.
  std::optional<int32_t> shots_from;
  // Least time between two answers without shots; 0: the daemon's default.
  Duration min_interval{};
  // Gives up when the daemon could not be reached for so long.
  Duration patience = kPatience;
  BreakCallback on_break;
};

// Calls `on_update` (on this thread) with every answer until the run has ended or `on_update`
// returns false; returns the run as last seen. Errors: the daemon's (NOT_FOUND / RUN_NOT_FOUND …),
// CONNECTION_LOST or CANNOT_CONNECT, CLIENT_CANCELLED.
absl::StatusOr<v1::Run> WatchRun(Connection& connection, const std::string& name,
                                 WatchOptions options, Canceller& canceller,
                                 absl::FunctionRef<bool(const v1::WatchRunResponse&)> on_update);

}  // namespace lightstage::client
