// Work that may crash, hang or eat memory on bad input, in a process of its own: importers of files from strangers.
#pragma once

#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"

namespace lightstage::sim {

// Runs `work` in a child process and returns what it returned. ABORTED / CHILD saying how it ended if it did not come back: it crashed,
// took more than a minute of processor time, or more than 4 GiB of memory on top of this process'. `work` sees a copy of everything and may
// change nothing; it must not start threads or wait for any.
absl::StatusOr<std::string> RunInChild(absl::FunctionRef<absl::StatusOr<std::string>()> work);

}  // namespace lightstage::sim
