#include "base/fault_env.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>

#include "base/status.h"

namespace lightstage {
namespace {

std::string FolderOf(const std::string& path) {
  return std::filesystem::path(path).parent_path().lexically_normal().string();
}

std::string Normal(const std::string& path) {
  std::filesystem::path p = std::filesystem::path(path).lexically_normal();
  return p.has_filename() ? p.string() : p.parent_path().string();
}

}  // namespace

class FaultEnv::FaultAppendFile final : public AppendFile {
 public:
  FaultAppendFile(FaultEnv& env, std::unique_ptr<AppendFile> file, std::string path)
      : env_(env), file_(std::move(file)), path_(std::move(path)) {}

  absl::Status Append(std::string_view bytes) override {
    RETURN_IF_ERROR(env_.Check(EnvOp::kAppend, path_));
    uint64_t fits = env_.TakeRoom(bytes.size(), /*partly=*/true);
    RETURN_IF_ERROR(file_->Append(bytes.substr(0, fits)));
    if (fits < bytes.size()) return ErrnoError(ENOSPC, "write", path_);
    return absl::OkStatus();
  }

  absl::Status Sync() override {
    RETURN_IF_ERROR(env_.Check(EnvOp::kSync, path_));
    RETURN_IF_ERROR(file_->Sync());
    auto size = env_.base_.FileSize(path_);
    MutexLock lock(&env_.mutex_);
    if (size.ok()) env_.synced_size_[path_] = *size;
    return absl::OkStatus();
  }

 private:
  FaultEnv& env_;
  std::unique_ptr<AppendFile> file_;
  const std::string path_;
};

void FaultEnv::FillDiskAfter(uint64_t bytes) {
  MutexLock lock(&mutex_);
  room_ = bytes;
}

void FaultEnv::FreeDisk() {
  MutexLock lock(&mutex_);
  room_.reset();
}

void FaultEnv::SetFreeBytes(std::optional<uint64_t> bytes) {
  MutexLock lock(&mutex_);
  free_bytes_ = bytes;
}

void FaultEnv::Fail(EnvOp op, std::string path_part, absl::Status status, int times) {
  MutexLock lock(&mutex_);
  failures_.push_back({op, std::move(path_part), std::move(status), times});
}

absl::Status FaultEnv::LosePower() {
  MutexLock lock(&mutex_);
  for (const auto& [folder, names] : new_names_) {
    for (const std::string& path : names) {
      synced_size_.erase(path);
      if (base_.Exists(path)) RETURN_IF_ERROR(base_.Remove(path));
    }
  }
  for (const auto& [path, size] : synced_size_) {
    if (base_.Exists(path)) RETURN_IF_ERROR(base_.Truncate(path, size));
  }
  new_names_.clear();
  synced_size_.clear();
  return absl::OkStatus();
}

absl::Status FaultEnv::Check(EnvOp op, const std::string& path) {
  MutexLock lock(&mutex_);
  for (Failure& failure : failures_) {
    if (failure.op == op && failure.left > 0 && path.find(failure.path_part) != std::string::npos) {
      --failure.left;
      return failure.status;
    }
  }
  return absl::OkStatus();
}

uint64_t FaultEnv::TakeRoom(uint64_t bytes, bool partly) {
  MutexLock lock(&mutex_);
  if (!room_) return bytes;
  uint64_t fits = std::min(bytes, *room_);
  if (fits < bytes && !partly) {
    *room_ = 0;  // the temporary file filled the disk before it was removed; other writers were
                 // refused meanwhile
    return 0;
  }
  *room_ -= fits;
  return fits;
}

absl::StatusOr<std::string> FaultEnv::ReadFile(const std::string& path) {
  RETURN_IF_ERROR(Check(EnvOp::kRead, path));
  return base_.ReadFile(path);
}

absl::StatusOr<std::string> FaultEnv::ReadInput(const std::string& path) {
  RETURN_IF_ERROR(Check(EnvOp::kRead, path));
  return base_.ReadInput(path);
}

absl::StatusOr<std::string> FaultEnv::ReadRange(const std::string& path, uint64_t offset,
                                                uint64_t length) {
  RETURN_IF_ERROR(Check(EnvOp::kRead, path));
  return base_.ReadRange(path, offset, length);
}

absl::Status FaultEnv::WriteFile(const std::string& path, std::string_view bytes) {
  RETURN_IF_ERROR(Check(EnvOp::kWriteFile, path));
  if (TakeRoom(bytes.size(), /*partly=*/false) < bytes.size()) {
    return ErrnoError(ENOSPC, "write", path);
  }
  bool existed = base_.Exists(path);
  RETURN_IF_ERROR(base_.WriteFile(path, bytes));
  MutexLock lock(&mutex_);
  if (!existed) new_names_[FolderOf(path)].insert(Normal(path));
  return absl::OkStatus();
}

absl::Status FaultEnv::SyncDirectory(const std::string& path) {
  RETURN_IF_ERROR(Check(EnvOp::kSyncDirectory, path));
  RETURN_IF_ERROR(base_.SyncDirectory(path));
  MutexLock lock(&mutex_);
  new_names_.erase(Normal(path));
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<AppendFile>> FaultEnv::OpenAppend(const std::string& path) {
  RETURN_IF_ERROR(Check(EnvOp::kOpenAppend, path));
  bool existed = base_.Exists(path);
  ASSIGN_OR_RETURN(auto file, base_.OpenAppend(path));
  ASSIGN_OR_RETURN(uint64_t size, base_.FileSize(path));
  MutexLock lock(&mutex_);
  if (!existed) new_names_[FolderOf(path)].insert(Normal(path));
  synced_size_.emplace(Normal(path), size);
  return std::make_unique<FaultAppendFile>(*this, std::move(file), Normal(path));
}

absl::Status FaultEnv::Truncate(const std::string& path, uint64_t size) {
  RETURN_IF_ERROR(Check(EnvOp::kTruncate, path));
  RETURN_IF_ERROR(base_.Truncate(path, size));
  MutexLock lock(&mutex_);
  if (auto it = synced_size_.find(Normal(path)); it != synced_size_.end()) it->second = size;
  return absl::OkStatus();
}

absl::Status FaultEnv::CreateDirectories(const std::string& path) {
  RETURN_IF_ERROR(Check(EnvOp::kCreateDirectories, path));
  return base_.CreateDirectories(path);
}

absl::Status FaultEnv::Remove(const std::string& path) {
  RETURN_IF_ERROR(Check(EnvOp::kRemove, path));
  RETURN_IF_ERROR(base_.Remove(path));
  MutexLock lock(&mutex_);
  synced_size_.erase(Normal(path));
  if (auto it = new_names_.find(FolderOf(path)); it != new_names_.end()) {
    it->second.erase(Normal(path));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> FaultEnv::List(const std::string& path) {
  RETURN_IF_ERROR(Check(EnvOp::kList, path));
  return base_.List(path);
}

absl::StatusOr<uint64_t> FaultEnv::FileSize(const std::string& path) {
  return base_.FileSize(path);
}

bool FaultEnv::Exists(const std::string& path) { return base_.Exists(path); }

absl::StatusOr<uint64_t> FaultEnv::FreeBytes(const std::string& path) {
  {
    MutexLock lock(&mutex_);
    if (free_bytes_) return *free_bytes_;
  }
  return base_.FreeBytes(path);
}

absl::StatusOr<std::unique_ptr<FileLock>> FaultEnv::Lock(const std::string& path) {
  return base_.Lock(path);
}

}  // namespace lightstage
