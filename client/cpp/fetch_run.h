// Copies a run's dataset to a folder of this machine.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/env.h"
#include "client/cpp/canceller.h"
#include "client/cpp/connection.h"
#include "client/cpp/retry.h"
#include "lightstage/v1/run.pb.h"

namespace lightstage::client {

struct FetchProgress {
  int total_files = 0;
  int64_t total_bytes = 0;
  int fetched_files = 0;
  // Were there already, whole.
  int skipped_files = 0;
  // Did not arrive as recorded; FetchResult tells how.
  int bad_files = 0;
  // Of the files above.
  int64_t done_bytes = 0;

  int done_files() const { return fetched_files + skipped_files + bad_files; }
};

struct FetchProblem {
  std::string path;
  absl::Status status;
};

struct FetchResult {
  FetchProgress progress;
  // Files whose bytes differ from their record: DATA_LOSS / CHECKSUM_MISMATCH or SIZE_MISMATCH.
  // They were not written.
  std::vector<FetchProblem> problems;
};

struct FetchOptions {
  Duration patience = kPatience;
  BreakCallback on_break;
};

// `folder` is created if needed; FAILED_PRECONDITION / FOLDER_HOLDS_ANOTHER_RUN, FOLDER_NOT_EMPTY
// or FOLDER_IS_THE_RUNS (the one that the daemon writes) if it cannot be used. Afterwards it holds every file that the run held when this began. A
// file appears whole or not at all; one that is there with the recorded size and SHA-256 is not
// sent again, so a fetch that broke off is finished by another one. Files without a record
// (journal, manifest) are always sent. `on_file` is called on this thread when a file is in place,
// was skipped or was bad. Memory: the largest file. Errors end the fetch: the daemon's, the
// filesystem's, CONNECTION_LOST, CLIENT_CANCELLED.
absl::StatusOr<FetchResult> FetchRun(
    Connection& connection, const std::string& name, const std::string& folder, Env& env,
    FetchOptions options, Canceller& canceller,
    absl::FunctionRef<void(const v1::DatasetFile&, const FetchProgress&)> on_file);

}  // namespace lightstage::client
