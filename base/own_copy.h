#pragma once

#include "absl/status/status.h"

namespace lightstage {

// The same error in memory of its own. Statuses that threads hand each other would share theirs, and how Debian's Abseil counts who still holds
// it ThreadSanitizer does not see (docs/decisions/0002-mutex.md).
absl::Status OwnCopy(const absl::Status& status);

}  // namespace lightstage
