#include "base/env.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "absl/strings/ascii.h"
#include "base/failpoint.h"
#include "base/status.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

// O_DIRECT wants buffer, offset and length in multiples of the device's logical block; a page suits
// every disk in use.
constexpr size_t kAlignment = 4096;
// One write of this size keeps a disk's queue full; more only costs memory.
constexpr size_t kDirectChunk = size_t{4} << 20;

class Fd {
 public:
  explicit Fd(int fd) : fd_(fd) {}
  Fd(Fd&& o) noexcept : fd_(std::exchange(o.fd_, -1)) {}
  Fd(const Fd&) = delete;
  Fd& operator=(const Fd&) = delete;
  Fd& operator=(Fd&&) = delete;
  ~Fd() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

absl::StatusOr<Fd> OpenFd(const std::string& path, int flags) {
  int fd;
  do {
    fd = ::open(path.c_str(), flags | O_CLOEXEC, 0644);
  } while (fd < 0 && errno == EINTR);
  if (fd < 0) return ErrnoError(errno, "open", path);
  return Fd(fd);
}

absl::Status NotRegular(const std::string& path) {
  return Error(absl::StatusCode::kFailedPrecondition, "FILE_NOT_REGULAR",
               absl::StrCat(path, " is there, but is no regular file"), {{"path", path}});
}

absl::Status TooLarge(const std::string& path, std::string_view than) {
  return Error(absl::StatusCode::kResourceExhausted, "FILE_TOO_LARGE",
               absl::StrCat(path, " is larger than ", than), {{"path", path}});
}
constexpr std::string_view kLargestInputText = "1 GiB, the most that is read";

// 0 or an errno.
int WriteFully(int fd, const char* data, size_t size) {
  while (size > 0) {
    ssize_t n = ::write(fd, data, size);
    if (n < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    data += n;
    size -= static_cast<size_t>(n);
  }
  return 0;
}

// Page-aligned memory that each writing thread keeps: touching fresh pages for every file costs as
// much as the copy itself.
class DirectBuffer {
 public:
  DirectBuffer() : data_(static_cast<char*>(std::aligned_alloc(kAlignment, kDirectChunk))) {}
  DirectBuffer(const DirectBuffer&) = delete;
  DirectBuffer& operator=(const DirectBuffer&) = delete;
  ~DirectBuffer() { std::free(data_); }
  char* data() { return data_; }

 private:
  char* data_;
};

// Writes `bytes` through an O_DIRECT descriptor; 0 or an errno, EINVAL if the filesystem does not
// do this after all.
int WriteDirect(int fd, std::string_view bytes) {
  thread_local DirectBuffer buffer;
  if (buffer.data() == nullptr) return ENOMEM;
  for (size_t done = 0; done < bytes.size(); done += kDirectChunk) {
    size_t take = std::min(kDirectChunk, bytes.size() - done);
    size_t padded = (take + kAlignment - 1) / kAlignment * kAlignment;
    std::memcpy(buffer.data(), bytes.data() + done, take);
    std::memset(buffer.data() + take, 0, padded - take);
    if (int error = WriteFully(fd, buffer.data(), padded)) return error;
  }
  if (bytes.size() % kAlignment != 0 && ::ftruncate(fd, static_cast<off_t>(bytes.size())) != 0) {
    return errno;
  }
  return 0;
}

class PosixAppendFile final : public AppendFile {
 public:
  PosixAppendFile(Fd fd, std::string path) : fd_(std::move(fd)), path_(std::move(path)) {}

  absl::Status Append(std::string_view bytes) override {
    if (int error = WriteFully(fd_.get(), bytes.data(), bytes.size())) {
      return ErrnoError(error, "write", path_);
    }
    return absl::OkStatus();
  }

  absl::Status Sync() override {
    if (::fdatasync(fd_.get()) != 0) return ErrnoError(errno, "fdatasync", path_);
    struct stat open, named;
    if (::fstat(fd_.get(), &open) != 0) return ErrnoError(errno, "stat", path_);
    if (::stat(path_.c_str(), &named) != 0) return ErrnoError(errno, "stat", path_);
    if (open.st_dev == named.st_dev && open.st_ino == named.st_ino) return absl::OkStatus();
    return Error(absl::StatusCode::kDataLoss, "FILE_REPLACED",
                 absl::StrCat("another file has been put in the place of ", path_,
                              ", which is being written"),
                 {{"path", path_}});
  }

 private:
  Fd fd_;
  const std::string path_;
};

class PosixFileLock final : public FileLock {
 public:
  explicit PosixFileLock(Fd fd) : fd_(std::move(fd)) {}

 private:
  Fd fd_;  // closing it gives the lock back
};

class PosixEnvImpl final : public Env {
 public:
  explicit PosixEnvImpl(const EnvOptions& options) : options_(options) {}

  absl::StatusOr<std::string> ReadFile(const std::string& path) override {
    return ReadRange(path, 0, UINT64_MAX);
  }

  absl::StatusOr<std::string> ReadInput(const std::string& path) override {
    ASSIGN_OR_RETURN(Fd fd, OpenFd(path, O_RDONLY));
    struct stat info;
    if (::fstat(fd.get(), &info) != 0) return ErrnoError(errno, "stat", path);
    if (S_ISDIR(info.st_mode)) return ErrnoError(EISDIR, "read", path);
    std::string bytes;
    for (char chunk[1 << 16];;) {
      ssize_t n = ::read(fd.get(), chunk, sizeof(chunk));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return ErrnoError(errno, "read", path);
      if (n == 0) return bytes;
      bytes.append(chunk, static_cast<size_t>(n));
      if (bytes.size() > kLargestInput) return TooLarge(path, kLargestInputText);
    }
  }

  absl::StatusOr<std::string> ReadRange(const std::string& path, uint64_t offset,
                                        uint64_t length) override {
    // O_NONBLOCK, so that opening a pipe does not wait for its writer.
    ASSIGN_OR_RETURN(Fd fd, OpenFd(path, O_RDONLY | O_NONBLOCK));
    struct stat info;
    if (::fstat(fd.get(), &info) != 0) return ErrnoError(errno, "stat", path);
    if (S_ISDIR(info.st_mode)) return ErrnoError(EISDIR, "read", path);
    if (!S_ISREG(info.st_mode)) return NotRegular(path);
    auto size = static_cast<uint64_t>(info.st_size);
    const uint64_t take = std::min(length, size - std::min(size, offset));
    const auto memory = static_cast<uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
                        static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
    if (take > memory) return TooLarge(path, "this machine's memory");
    std::string bytes(take, '\0');
    size_t done = 0;
    while (done < bytes.size()) {
      ssize_t n = ::pread(fd.get(), bytes.data() + done, bytes.size() - done,
                          static_cast<off_t>(offset + done));
      if (n < 0) {
        if (errno == EINTR) continue;
        return ErrnoError(errno, "read", path);
      }
      if (n == 0) break;  // it was truncated meanwhile
      done += static_cast<size_t>(n);
    }
    bytes.resize(done);
    return bytes;
  }

  absl::Status WriteFile(const std::string& name, std::string_view bytes) override {
    ASSIGN_OR_RETURN(const std::string path, Replaceable(name));
    // Numbered, so that two writers of one path do not mix their bytes.
    const std::string temporary = absl::StrCat(path, ".", next_temporary_++, ".tmp");
    absl::Status status = WriteAndSync(temporary, bytes);
    if (status.ok()) status = Failpoint("env.before_rename");
    if (status.ok() && ::rename(temporary.c_str(), path.c_str()) != 0) {
      status = ErrnoError(errno, "rename to", path);
    }
    if (!status.ok()) ::unlink(temporary.c_str());
    return status;
  }

  absl::Status SyncDirectory(const std::string& path) override {
    ASSIGN_OR_RETURN(Fd fd, OpenFd(path, O_RDONLY | O_DIRECTORY));
    if (::fsync(fd.get()) != 0) return ErrnoError(errno, "fsync", path);
    return absl::OkStatus();
  }

  absl::StatusOr<std::unique_ptr<AppendFile>> OpenAppend(const std::string& path) override {
    ASSIGN_OR_RETURN(Fd fd, OpenFd(path, O_WRONLY | O_CREAT | O_APPEND));
    return std::make_unique<PosixAppendFile>(std::move(fd), path);
  }

  absl::Status Truncate(const std::string& path, uint64_t size) override {
    ASSIGN_OR_RETURN(Fd fd, OpenFd(path, O_WRONLY));
    if (::ftruncate(fd.get(), static_cast<off_t>(size)) != 0) {
      return ErrnoError(errno, "truncate", path);
    }
    if (::fsync(fd.get()) != 0) return ErrnoError(errno, "fsync", path);
    return absl::OkStatus();
  }

  absl::Status CreateDirectories(const std::string& path) override {
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (error) return ErrnoError(error.value(), "create directory", path);
    return absl::OkStatus();
  }

  absl::Status Remove(const std::string& path) override {
    if (::unlink(path.c_str()) != 0) return ErrnoError(errno, "remove", path);
    return absl::OkStatus();
  }

  absl::StatusOr<std::vector<std::string>> List(const std::string& path) override {
    DIR* dir = ::opendir(path.c_str());
    if (dir == nullptr) return ErrnoError(errno, "list", path);
    std::vector<std::string> names;
    errno = 0;
    while (const dirent* entry = ::readdir(dir)) {
      std::string_view name = entry->d_name;
      if (name != "." && name != "..") names.emplace_back(name);
    }
    int error = errno;
    ::closedir(dir);
    if (error != 0) return ErrnoError(error, "list", path);
    std::sort(names.begin(), names.end());
    return names;
  }

  absl::StatusOr<uint64_t> FileSize(const std::string& path) override {
    struct stat info;
    if (::stat(path.c_str(), &info) != 0) return ErrnoError(errno, "stat", path);
    if (!S_ISREG(info.st_mode)) return NotRegular(path);
    return static_cast<uint64_t>(info.st_size);
  }

  bool Exists(const std::string& path) override { return ::access(path.c_str(), F_OK) == 0; }

  absl::StatusOr<uint64_t> FreeBytes(const std::string& path) override {
    struct statvfs info;
    if (::statvfs(path.c_str(), &info) != 0) return ErrnoError(errno, "statvfs", path);
    return static_cast<uint64_t>(info.f_bavail) * info.f_frsize;
  }

  absl::StatusOr<std::unique_ptr<FileLock>> Lock(const std::string& path) override {
    ASSIGN_OR_RETURN(Fd fd, OpenFd(path, O_RDWR | O_CREAT));
    if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK) return ErrnoError(errno, "lock", path);
      auto holder = ReadFile(path);
      std::string pid(absl::StripAsciiWhitespace(holder.ok() ? *holder : ""));
      if (pid.empty()) pid = "unknown";
      return Error(absl::StatusCode::kFailedPrecondition, "FILE_LOCKED",
                   absl::StrCat(path, " is locked by process ", pid),
                   {{"path", path}, {"pid", pid}});
    }
    std::string pid = absl::StrCat(::getpid(), "\n");
    if (::ftruncate(fd.get(), 0) != 0) return ErrnoError(errno, "truncate", path);
    if (int error = WriteFully(fd.get(), pid.data(), pid.size())) {
      return ErrnoError(error, "write", path);
    }
    return std::make_unique<PosixFileLock>(std::move(fd));
  }

 private:
  // The regular file, perhaps not there yet, that writing to `name` means. Renaming over a device, a socket or a link would replace
  // that itself.
  static absl::StatusOr<std::string> Replaceable(const std::string& name) {
    struct stat info;
    if (::lstat(name.c_str(), &info) != 0) {
      if (errno == ENOENT) return name;
      return ErrnoError(errno, "stat", name);
    }
    std::string path = name;
    if (S_ISLNK(info.st_mode)) {
      std::error_code error;
      path = std::filesystem::canonical(name, error);
      if (error) return ErrnoError(error.value(), "follow the link", name);
      if (::stat(path.c_str(), &info) != 0) return ErrnoError(errno, "stat", path);
    }
    if (S_ISDIR(info.st_mode)) return ErrnoError(EISDIR, "write", name);
    if (S_ISREG(info.st_mode)) return path;
    return NotRegular(name);
  }

  absl::Status WriteAndSync(const std::string& path, std::string_view bytes) {
    constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
    // Less than a block is not worth a direct write.
    if (options_.direct_io && bytes.size() >= kAlignment) {
      auto fd = OpenFd(path, kFlags | O_DIRECT);
      int error = fd.ok() ? WriteDirect(fd->get(), bytes) : errno;
      if (fd.ok() && error == 0) return SyncData(fd->get(), path);
      if (error != EINVAL) return fd.ok() ? ErrnoError(error, "write", path) : fd.status();
      if (!no_direct_logged_.exchange(true)) {
        spdlog::warn("{}: this filesystem has no O_DIRECT; files go through the page cache", path);
      }
    }
    ASSIGN_OR_RETURN(Fd fd, OpenFd(path, kFlags));
    if (int error = WriteFully(fd.get(), bytes.data(), bytes.size())) {
      return ErrnoError(error, "write", path);
    }
    return SyncData(fd.get(), path);
  }

  static absl::Status SyncData(int fd, const std::string& path) {
    if (::fdatasync(fd) != 0) return ErrnoError(errno, "fdatasync", path);
    return absl::OkStatus();
  }

  const EnvOptions options_;
  std::atomic<uint64_t> next_temporary_{0};
  std::atomic<bool> no_direct_logged_{false};
};

}  // namespace

std::unique_ptr<Env> MakePosixEnv(const EnvOptions& options) {
  return std::make_unique<PosixEnvImpl>(options);
}

Env& PosixEnv() {
  static Env& env =
      *MakePosixEnv(EnvOptions{}).release();  // never destroyed: threads may outlive main
  return env;
}

absl::StatusOr<std::string> ReadNamedFile(const std::string& path, Env& env) {
  ASSIGN_OR_RETURN(const uint64_t size, env.FileSize(path));
  if (size > kLargestInput) return TooLarge(path, kLargestInputText);
  return env.ReadFile(path);
}

}  // namespace lightstage
