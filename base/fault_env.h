// A filesystem that fails on purpose, around another one: full disks, failing operations, lost
// power. For tests.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/env.h"
#include "base/mutex.h"

namespace lightstage {

enum class EnvOp {
  kRead,
  kWriteFile,
  kSyncDirectory,
  kOpenAppend,
  kAppend,
  kSync,
  kTruncate,
  kCreateDirectories,
  kRemove,
  kList
};

// Thread-safe. `base` must outlive it.
class FaultEnv final : public Env {
 public:
  explicit FaultEnv(Env& base) : base_(base) {}

  // After `bytes` more bytes everything written fails with DISK_FULL, until FreeDisk(). A write
  // that does not fit whole takes what fits when appending, as a real disk does, and nothing when
  // writing a file.
  void FillDiskAfter(uint64_t bytes);
  void FreeDisk();
  // What FreeBytes() says; without a value, the truth.
  void SetFreeBytes(std::optional<uint64_t> bytes);

  // The next `times` calls of `op` whose path contains `path_part` fail with `status`, without
  // being done.
  void Fail(EnvOp op, std::string path_part, absl::Status status, int times = 1);

  // What a power cut leaves in the worst case: appended bytes that were not synced are gone, and so
  // are files whose folder was not synced after they were written. Only what went through this
  // object counts. Nothing may be open.
  absl::Status LosePower();

  absl::StatusOr<std::string> ReadFile(const std::string& path) override;
  absl::StatusOr<std::string> ReadInput(const std::string& path) override;
  absl::StatusOr<std::string> ReadRange(const std::string& path, uint64_t offset,
                                        uint64_t length) override;
  absl::Status WriteFile(const std::string& path, std::string_view bytes) override;
  absl::Status SyncDirectory(const std::string& path) override;
  absl::StatusOr<std::unique_ptr<AppendFile>> OpenAppend(const std::string& path) override;
  absl::Status Truncate(const std::string& path, uint64_t size) override;
  absl::Status CreateDirectories(const std::string& path) override;
  absl::Status Remove(const std::string& path) override;
  absl::StatusOr<std::vector<std::string>> List(const std::string& path) override;
  absl::StatusOr<uint64_t> FileSize(const std::string& path) override;
  bool Exists(const std::string& path) override;
  absl::StatusOr<uint64_t> FreeBytes(const std::string& path) override;
  absl::StatusOr<std::unique_ptr<FileLock>> Lock(const std::string& path) override;

 private:
  class FaultAppendFile;
  struct Failure {
    EnvOp op;
    std::string path_part;
    absl::Status status;
    int left;
  };

  absl::Status Check(EnvOp op, const std::string& path);
  // How many of `bytes` still fit; takes them.
  uint64_t TakeRoom(uint64_t bytes, bool partly);

  Env& base_;
  Mutex mutex_;
  std::vector<Failure> failures_ ABSL_GUARDED_BY(mutex_);
  std::optional<uint64_t> room_ ABSL_GUARDED_BY(mutex_);
  std::optional<uint64_t> free_bytes_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, uint64_t> synced_size_ ABSL_GUARDED_BY(mutex_);  // of append files
  std::map<std::string, std::set<std::string>> new_names_ ABSL_GUARDED_BY(mutex_);  // by folder
};

}  // namespace lightstage
