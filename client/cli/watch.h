// Shows a run until it is over, as `capture` and `runs watch` do.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "client/cli/session.h"

namespace lightstage::client {

struct WatchFlags {
  // Goes on while the run is paused or interrupted, instead of ending with kRunNotDone.
  bool through_pauses = false;
  // Prints stored shots too, from this many on.
  std::optional<int> shots_from;
};

// kOk if the run succeeded, kRunNotDone if it did not or waits for somebody, kInterrupted on
// Ctrl-C: the run goes on.
absl::StatusOr<ExitCode> WatchToEnd(Session& session, const std::string& run,
                                    const WatchFlags& flags);

}  // namespace lightstage::client
