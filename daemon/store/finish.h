// What turns a run's folder into a dataset that others can read.
#pragma once

#include "absl/status/status.h"
#include "daemon/store/run_folder.h"

namespace lightstage {

// Writes the light positions, then manifest.json, durably; both hold the shots in the order of their ids. May be called again.
absl::Status Finish(const RunFolder& run);

}  // namespace lightstage
