// Named places where a test can make the program fail: FAILPOINT-style crash and error injection for the daemon's durability
// tests. Inactive unless the environment variable LIGHTSTAGED_FAILPOINTS is set, e.g.
//   LIGHTSTAGED_FAILPOINTS="store.after_rename=kill:37;store.journal=error:5"
// "kill:N" sends SIGKILL to this process at the Nth hit; "error:N" makes the Nth hit return an error (INTERNAL, FAILPOINT).
#pragma once

#include <string_view>

#include "absl/status/status.h"

namespace lightstage {

// OK unless this point is active and due. Costs one relaxed load when no point is active. Thread-safe.
absl::Status Failpoint(std::string_view name);

// Replaces the active set (tests). An unreadable spec is INVALID_ARGUMENT and leaves the set empty.
absl::Status SetFailpoints(std::string_view spec);

// Activates what LIGHTSTAGED_FAILPOINTS says; the daemon calls it once at start.
absl::Status SetFailpointsFromEnvironment();

}  // namespace lightstage
