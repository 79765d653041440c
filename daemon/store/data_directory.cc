#include "daemon/store/data_directory.h"

#include <algorithm>

#include "absl/time/time.h"
#include "base/status.h"
#include "daemon/store/layout.h"
#include "dataset/manifest.h"
#include "spdlog/spdlog.h"

namespace lightstage {

absl::StatusOr<std::unique_ptr<DataDirectory>> DataDirectory::Open(Env& env, std::string path) {
  RETURN_IF_ERROR(env.CreateDirectories(absl::StrCat(path, "/", kRunsFolder)));
  auto lock = env.Lock(absl::StrCat(path, "/", kLockFile));
  if (ErrorReason(lock.status()) == "FILE_LOCKED") {
    std::string pid = "unknown";
    for (const auto& [key, value] : ErrorMetadataOf(lock.status())) {
      if (key == "pid") pid = value;
    }
    return Error(
        absl::StatusCode::kFailedPrecondition, "DATA_DIRECTORY_LOCKED",
        absl::StrCat("data directory ", path, " is in use by another lightstaged, process ", pid,
                     "; stop it or use another directory"),
        {{"path", path}, {"pid", pid}});
  }
  RETURN_IF_ERROR(lock.status());
  RETURN_IF_ERROR(env.SyncDirectory(path));
  auto directory =
      std::unique_ptr<DataDirectory>(new DataDirectory(env, std::move(path), *std::move(lock)));
  RETURN_IF_ERROR(directory->RemoveTemporaries());
  return directory;
}

std::string DataDirectory::RunPath(const std::string& id) const {
  return absl::StrCat(path_, "/", kRunsFolder, "/", id);
}

absl::Status DataDirectory::RemoveTemporaries() const {
  ASSIGN_OR_RETURN(std::vector<std::string> ids, ListRuns());
  for (const std::string& id : ids) {
    std::string run = RunPath(id);
    // The manifest is written last: where it stands, no temporary file is left.
    if (env_.Exists(absl::StrCat(run, "/", kManifestFile))) continue;
    std::vector<std::string> folders = {run};
    for (const char* images : kImageFolders) folders.push_back(absl::StrCat(run, "/", images));
    for (const std::string& folder : folders) {
      auto names = env_.List(folder);
      if (!names.ok()) {
        // One broken run must not keep the daemon from the others; opening this one will say what is wrong.
        spdlog::warn("run {}: {}", id, std::string(names.status().message()));
        continue;
      }
      for (const std::string& name : *names) {
        if (!name.ends_with(kTemporarySuffix)) continue;
        spdlog::info("run {}: removing the unfinished {}/{}", id, folder, name);
        RETURN_IF_ERROR(env_.Remove(absl::StrCat(folder, "/", name)));
      }
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> DataDirectory::ListRuns() const {
  ASSIGN_OR_RETURN(std::vector<std::string> names,
                   env_.List(absl::StrCat(path_, "/", kRunsFolder)));
  std::vector<std::string> ids;
  for (std::string& name : names) {
    if (env_.Exists(absl::StrCat(RunPath(name), "/", kRunFile))) ids.push_back(std::move(name));
  }
  std::reverse(ids.begin(), ids.end());  // ids begin with their time
  return ids;
}

absl::StatusOr<std::unique_ptr<RunFolder>> DataDirectory::CreateRun(RunHeader header,
                                                                    std::string_view rig_text,
                                                                    WallTime created) {
  MutexLock lock(&create_mutex_);
  std::string stem =
      absl::FormatTime("%Y%m%d-%H%M%S", absl::FromChrono(created), absl::UTCTimeZone());
  header.id = stem;
  for (int n = 2; env_.Exists(RunPath(header.id)); ++n) header.id = absl::StrCat(stem, "-", n);
  header.created_at = FormatUtc(created);
  if (header.name.empty()) header.name = header.id;
  return RunFolder::Create(env_, RunPath(header.id), header, rig_text);
}

absl::StatusOr<std::unique_ptr<RunFolder>> DataDirectory::OpenRun(const std::string& id) const {
  bool plain = !id.empty() && id.find('/') == std::string::npos && id[0] != '.';
  if (!plain || !env_.Exists(absl::StrCat(RunPath(id), "/", kRunFile))) {
    return Error(absl::StatusCode::kNotFound, "RUN_NOT_FOUND",
                 absl::StrCat("there is no run '", id, "' in ", path_),
                 {{"run", id}, {"path", path_}});
  }
  return RunFolder::Open(env_, RunPath(id));
}

}  // namespace lightstage
