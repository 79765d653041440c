#include "client/cpp/fetch_run.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_split.h"
#include "base/status.h"
#include "base/strings.h"
#include "openssl/evp.h"

namespace lightstage::client {
namespace {

constexpr uint64_t kHashChunk = uint64_t{4} << 20;
constexpr char kRunFile[] = "run.json";  // docs/DATASET.md

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new()) {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }
  void Add(std::string_view bytes) { EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()); }
  std::string Hex() {
    unsigned char digest[EVP_MAX_MD_SIZE];
    unsigned int size = 0;
    EVP_DigestFinal_ex(context_.get(), digest, &size);
    return absl::BytesToHexString(absl::string_view(reinterpret_cast<char*>(digest), size));
  }

 private:
  struct Free {
    void operator()(EVP_MD_CTX* c) const { EVP_MD_CTX_free(c); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context_;
};

// The daemon names the files, so a path must not lead out of the folder.
absl::Status CheckPath(const std::string& path) {
  bool bad = path.empty() || path.find('\0') != std::string::npos;
  for (absl::string_view part : absl::StrSplit(path, '/')) {
    bad = bad || part.empty() || part == "." || part == "..";
  }
  if (!bad) return absl::OkStatus();
  return Error(absl::StatusCode::kInternal, "FILE_PATH_UNSAFE",
               absl::StrCat("the daemon lists a file '", path,
                            "'; a dataset holds only relative paths without . and .."),
               {{"file", path}});
}

std::string FolderOf(const std::string& path) {
  size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

class Fetcher {
 public:
  Fetcher(Connection& connection, const std::string& name, const std::string& folder, Env& env,
          FetchOptions& options, Canceller& canceller)
      : connection_(connection),
        name_(name),
        folder_(folder),
        env_(env),
        options_(options),
        canceller_(canceller) {}

  absl::StatusOr<std::vector<v1::DatasetFile>> List() {
    std::vector<v1::DatasetFile> files;
    v1::ListFilesRequest request;
    request.set_parent(name_);
    request.set_page_size(10000);
    Retry retry(connection_, canceller_, options_.patience, options_.on_break);
    do {
      auto page = Call(connection_.runs(), &v1::RunService::Stub::ListFiles, request, canceller_);
      if (!page.ok()) {
        RETURN_IF_ERROR(retry.AfterBreak(page.status()));
        continue;
      }
      retry.Progressed();
      for (v1::DatasetFile& file : *page->mutable_files()) {
        RETURN_IF_ERROR(CheckPath(file.path()));
        files.push_back(std::move(file));
      }
      request.set_page_token(page->next_page_token());
      if (request.page_token().empty()) break;
    } while (true);
    return files;
  }

  // Where the daemon is on this machine, the folder may be the run's own: the daemon writes there.
  absl::Status CheckElsewhere() {
    v1::GetRunRequest request;
    request.set_name(name_);
    ASSIGN_OR_RETURN(v1::GetRunResponse run,
                     Call(connection_.runs(), &v1::RunService::Stub::GetRun, request, canceller_));
    std::error_code error;
    if (!std::filesystem::equivalent(folder_, run.run().directory(), error))
      return absl::OkStatus();
    return Error(absl::StatusCode::kFailedPrecondition, "FOLDER_IS_THE_RUNS",
                 absl::StrCat(folder_, " is the run's own folder: give another one"),
                 {{"path", folder_}});
  }

  // A folder belongs to the run whose run.json, which never changes, lies in it; that is therefore fetched first. A folder without one
  // must be empty.
  absl::Status Claim(std::vector<v1::DatasetFile>& files) {
    auto header = std::find_if(files.begin(), files.end(),
                               [](const v1::DatasetFile& f) { return f.path() == kRunFile; });
    if (header == files.end()) {
      return Error(absl::StatusCode::kDataLoss, "RUN_FILE_MISSING",
                   absl::StrCat("the daemon lists no ", kRunFile, " in ", name_), {{"run", name_}});
    }
    std::rotate(files.begin(), header, header + 1);
    if (!env_.Exists(LocalPath(files[0]))) {
      ASSIGN_OR_RETURN(std::vector<std::string> names, env_.List(folder_));
      std::erase_if(names, [](const std::string& name) { return name.ends_with(".tmp"); });
      if (names.empty()) return absl::OkStatus();
      return Error(absl::StatusCode::kFailedPrecondition, "FOLDER_NOT_EMPTY",
                   absl::StrCat(folder_, " holds ", names[0],
                                ", but no run: give an empty folder, or "
                                "one that an earlier fetch of this run left"),
                   {{"path", folder_}});
    }
    ASSIGN_OR_RETURN(std::string here, env_.ReadFile(LocalPath(files[0])));
    ASSIGN_OR_RETURN(std::string there, Read(files[0]));
    header_is_here_ = here == there;
    if (header_is_here_) return absl::OkStatus();
    return Error(
        absl::StatusCode::kFailedPrecondition, "FOLDER_HOLDS_ANOTHER_RUN",
        absl::StrCat(LocalPath(files[0]), " is not that of ", name_, ": give another folder"),
        {{"path", folder_}, {"run", name_}});
  }

  // True if the file is here already, as recorded.
  absl::StatusOr<bool> IsHere(const v1::DatasetFile& file) {
    std::string path = LocalPath(file);
    if (file.path() == kRunFile) return header_is_here_;
    if (file.sha256().empty() || !env_.Exists(path)) return false;
    ASSIGN_OR_RETURN(uint64_t size, env_.FileSize(path));
    if (size != static_cast<uint64_t>(file.bytes())) return false;
    Sha256 sha;
    for (uint64_t offset = 0; offset < size;) {
      ASSIGN_OR_RETURN(std::string part, env_.ReadRange(path, offset, kHashChunk));
      if (part.empty()) return false;  // it shrank meanwhile
      sha.Add(part);
      offset += part.size();
    }
    return sha.Hex() == file.sha256();
  }

  // Reads the file whole. DATA_LOSS if it is not as recorded.
  absl::StatusOr<std::string> Read(const v1::DatasetFile& file) {
    std::string bytes;
    int64_t total = 0;
    v1::ReadFileRequest request;
    request.set_name(name_);
    request.set_path(file.path());
    Retry retry(connection_, canceller_, options_.patience, options_.on_break);
    for (;;) {
      request.set_offset(static_cast<int64_t>(bytes.size()));
      absl::Status status = ReadStream(connection_.runs(), &v1::RunService::Stub::ReadFile, request,
                                       canceller_, [&](const v1::ReadFileResponse& part) {
                                         retry.Progressed();
                                         total = std::max(total, part.total_bytes());
                                         bytes += part.data();
                                         return true;
                                       });
      if (status.ok()) break;
      RETURN_IF_ERROR(retry.AfterBreak(status));
    }
    // A file without a record may have grown since it was listed.
    int64_t expected = file.sha256().empty() ? total : file.bytes();
    if (static_cast<int64_t>(bytes.size()) != expected) {
      return Error(
          absl::StatusCode::kDataLoss, "SIZE_MISMATCH",
          absl::StrCat(file.path(), " came with ", bytes.size(), " bytes instead of ", expected),
          {{"file", file.path()},
           {"bytes", absl::StrCat(bytes.size())},
           {"expected_bytes", absl::StrCat(expected)}});
    }
    Sha256 sha;
    sha.Add(bytes);
    std::string hex = sha.Hex();
    if (!file.sha256().empty() && hex != file.sha256()) {
      return Error(
          absl::StatusCode::kDataLoss, "CHECKSUM_MISMATCH",
          absl::StrCat(file.path(), " came with SHA-256 ", hex, " instead of ", file.sha256()),
          {{"file", file.path()}, {"sha256", hex}, {"expected_sha256", file.sha256()}});
    }
    return bytes;
  }

  absl::Status Write(const v1::DatasetFile& file, std::string_view bytes) {
    std::string folder = FolderOf(LocalPath(file));
    if (folders_.insert(folder).second) RETURN_IF_ERROR(env_.CreateDirectories(folder));
    return env_.WriteFile(LocalPath(file), bytes);
  }

  // Makes the names of what was written durable.
  absl::Status Sync() {
    for (const std::string& folder : folders_) RETURN_IF_ERROR(env_.SyncDirectory(folder));
    return absl::OkStatus();
  }

 private:
  std::string LocalPath(const v1::DatasetFile& file) const {
    return absl::StrCat(folder_, "/", file.path());
  }

  Connection& connection_;
  const std::string& name_;
  const std::string& folder_;
  Env& env_;
  FetchOptions& options_;
  Canceller& canceller_;
  bool header_is_here_ = false;
  std::set<std::string> folders_;  // that something was written into
};

}  // namespace

absl::StatusOr<FetchResult> FetchRun(
    Connection& connection, const std::string& name, const std::string& folder, Env& env,
    FetchOptions options, Canceller& canceller,
    absl::FunctionRef<void(const v1::DatasetFile&, const FetchProgress&)> on_file) {
  RETURN_IF_ERROR(env.CreateDirectories(folder));
  Fetcher fetcher(connection, name, folder, env, options, canceller);
  RETURN_IF_ERROR(fetcher.CheckElsewhere());
  ASSIGN_OR_RETURN(std::vector<v1::DatasetFile> files, fetcher.List());
  RETURN_IF_ERROR(fetcher.Claim(files));
  FetchResult result;
  FetchProgress& progress = result.progress;
  progress.total_files = static_cast<int>(files.size());
  for (const auto& file : files) progress.total_bytes += file.bytes();
  for (const auto& file : files) {
    if (canceller.cancelled()) {
      return Error(absl::StatusCode::kCancelled, kCancelled, "cancelled");
    }
    ASSIGN_OR_RETURN(bool here, fetcher.IsHere(file));
    if (here) {
      ++progress.skipped_files;
    } else {
      auto bytes = fetcher.Read(file);
      if (bytes.ok()) {
        RETURN_IF_ERROR(fetcher.Write(file, *bytes));
        ++progress.fetched_files;
      } else if (absl::IsDataLoss(bytes.status())) {
        result.problems.push_back({file.path(), bytes.status()});
        ++progress.bad_files;
      } else {
        return bytes.status();
      }
    }
    progress.done_bytes += file.bytes();
    on_file(file, progress);
  }
  RETURN_IF_ERROR(fetcher.Sync());
  return result;
}

}  // namespace lightstage::client
