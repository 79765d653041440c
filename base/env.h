// The filesystem, injectable: PosixEnv() is the real one, FaultEnv (base/fault_env.h) fails on
// purpose.
//
// All calls are thread-safe and block. Errors name the operation and the path (base/status.h
// ErrnoError): NOT_FOUND, RESOURCE_EXHAUSTED/DISK_FULL, PERMISSION_DENIED, INTERNAL/FILE_IO.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace lightstage {

// A file that is only appended to. Append() may be buffered by the kernel; after Sync() returns OK
// all of it is durable, under the name that it was opened by: DATA_LOSS / FILE_REPLACED or NOT_FOUND
// if something else, or nothing, is there now.
class AppendFile {
 public:
  virtual ~AppendFile() = default;
  virtual absl::Status Append(std::string_view bytes) = 0;
  virtual absl::Status Sync() = 0;
};

// Bytes; more than any input that somebody means: neither a stream that never ends nor a wrong file may fill the memory.
constexpr uint64_t kLargestInput = uint64_t{1} << 30;

// Held by one process at a time, until destroyed or until the process ends, however it ends.
class FileLock {
 public:
  virtual ~FileLock() = default;
};

class Env {
 public:
  virtual ~Env() = default;

  // FAILED_PRECONDITION / FILE_NOT_REGULAR of pipes and devices; RESOURCE_EXHAUSTED / FILE_TOO_LARGE if it is larger than the machine's memory.
  virtual absl::StatusOr<std::string> ReadFile(const std::string& path) = 0;
  // What a user named on the command line: also a pipe, to its end. May wait for its writer. RESOURCE_EXHAUSTED / FILE_TOO_LARGE
  // if it has more than kLargestInput.
  virtual absl::StatusOr<std::string> ReadInput(const std::string& path) = 0;
  // Up to `length` bytes from `offset`; fewer only at the end of the file.
  virtual absl::StatusOr<std::string> ReadRange(const std::string& path, uint64_t offset,
                                                uint64_t length) = 0;
  // Writes a whole new file so that `path` never names a partial one: temporary file beside it,
  // data synced, renamed. A link is followed; FAILED_PRECONDITION / FILE_NOT_REGULAR if a device, a
  // pipe or a socket is there. The name itself is durable only after SyncDirectory() of its folder.
  virtual absl::Status WriteFile(const std::string& path, std::string_view bytes) = 0;
  virtual absl::Status SyncDirectory(const std::string& path) = 0;
  // Creates the file if needed.
  virtual absl::StatusOr<std::unique_ptr<AppendFile>> OpenAppend(const std::string& path) = 0;
  virtual absl::Status Truncate(const std::string& path, uint64_t size) = 0;

  virtual absl::Status CreateDirectories(const std::string& path) = 0;
  virtual absl::Status Remove(const std::string& path) = 0;
  // Names in a folder, sorted, without "." and "..".
  virtual absl::StatusOr<std::vector<std::string>> List(const std::string& path) = 0;
  // FAILED_PRECONDITION / FILE_NOT_REGULAR of folders, pipes and devices.
  virtual absl::StatusOr<uint64_t> FileSize(const std::string& path) = 0;
  virtual bool Exists(const std::string& path) = 0;
  // Bytes that an unprivileged user can still write on the filesystem that holds `path`.
  virtual absl::StatusOr<uint64_t> FreeBytes(const std::string& path) = 0;

  // Takes the lock file, creating it if needed, and writes this process' id into it.
  // FAILED_PRECONDITION / FILE_LOCKED with the holder's id as metadata "pid" if somebody has it.
  virtual absl::StatusOr<std::unique_ptr<FileLock>> Lock(const std::string& path) = 0;
};

struct EnvOptions {
  // WriteFile passes by the page cache where the filesystem can
  // (docs/decisions/0004-how-bytes-go-out.md). Where it can not, that is logged once and the cache
  // is used.
  bool direct_io = true;
};

std::unique_ptr<Env> MakePosixEnv(const EnvOptions& options);

// The process' own, with the default options.
Env& PosixEnv();

// A regular file that an input names in its turn. RESOURCE_EXHAUSTED / FILE_TOO_LARGE if it has more than kLargestInput.
absl::StatusOr<std::string> ReadNamedFile(const std::string& path, Env& env);

}  // namespace lightstage
