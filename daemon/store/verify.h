// Reads a whole dataset again and compares it with what its journal promises.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/store/run_folder.h"

namespace lightstage {

struct VerifyProblem {
  std::string file;     // relative to the run's folder
  absl::Status reason;  // DATA_LOSS, NOT_FOUND …; its message stands without the file's name
};

struct VerifyHooks {
  // Called on the caller's thread; any may be empty.
  std::function<void(uint64_t checked, uint64_t total)> progress;  // files
  std::function<void(const VerifyProblem&)> problem;               // as found
  std::function<bool()> cancelled;                                 // asked before every file
};

// Checks the journal, every recorded file (size, SHA-256, EXR header and shape), files without record, and the manifest and light
// positions against the journal. CANCELLED if asked to stop; what cannot be read is a problem, not an error. Files without
// record and the manifest are left out while the run is being captured.
absl::StatusOr<std::vector<VerifyProblem>> Verify(const RunFolder& run, const VerifyHooks& hooks);

}  // namespace lightstage
