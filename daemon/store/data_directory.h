// A daemon's data directory: the lock that makes it one daemon's, and its runs.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/env.h"
#include "daemon/store/run_folder.h"

namespace lightstage {

// Thread-safe. `env` must outlive it.
class DataDirectory {
 public:
  // Creates the folder if needed, locks it, and removes temporary files that a crash left. FAILED_PRECONDITION /
  // DATA_DIRECTORY_LOCKED naming the other daemon's process id.
  static absl::StatusOr<std::unique_ptr<DataDirectory>> Open(Env& env, std::string path);

  const std::string& path() const { return path_; }

  // Ids of all runs, newest first. A folder whose creation was not finished is none.
  absl::StatusOr<std::vector<std::string>> ListRuns() const;
  // Gives `header` an id made of `created` ("20040506-070809", a suffix if it is taken) and created_at, and makes its folder,
  // ready for appending.
  absl::StatusOr<std::unique_ptr<RunFolder>> CreateRun(RunHeader header, std::string_view rig_text,
                                                       WallTime created);
  // NOT_FOUND / RUN_NOT_FOUND.
  absl::StatusOr<std::unique_ptr<RunFolder>> OpenRun(const std::string& id) const;

 private:
  DataDirectory(Env& env, std::string path, std::unique_ptr<FileLock> lock)
      : env_(env), path_(std::move(path)), lock_(std::move(lock)) {}

  std::string RunPath(const std::string& id) const;
  absl::Status RemoveTemporaries() const;

  Env& env_;
  const std::string path_;
  const std::unique_ptr<FileLock> lock_;
  Mutex create_mutex_;  // two runs created in one second must not get one id
};

}  // namespace lightstage
