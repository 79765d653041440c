#include "daemon/store/run_folder.h"

#include <algorithm>
#include <filesystem>

#include "absl/strings/str_format.h"
#include "base/failpoint.h"
#include "base/status.h"
#include "base/utf8.h"
#include "daemon/store/journal.h"
#include "daemon/store/layout.h"
#include "dataset/record_json.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

constexpr int kJournalVersion = 1;

std::string Join(std::string_view folder, std::string_view name) {
  return absl::StrCat(folder, "/", name);
}

std::string StartLine(const std::string& run_id) {
  return JournalLine(
      Json({{"type", "journal"}, {"version", kJournalVersion}, {"run", run_id}}).dump());
}

std::string RecordLine(const ShotRecord& record) {
  return JournalLine(Json({{"type", "shot"}, {"record", ToJson(record)}}).dump());
}

std::string LostLine(const std::set<uint64_t>& shot_ids) {
  return JournalLine(Json({{"type", "lost"}, {"shots", shot_ids}}).dump());
}

std::string StateLine(RunState state, const absl::Status& reason, const std::string& at) {
  Json json = {{"type", "state"}, {"state", RunStateName(state)}, {"at", at}};
  if (!reason.ok()) {
    Json metadata = Json::object();
    for (const auto& [key, value] : ErrorMetadataOf(reason)) metadata[key] = value;
    json["reason"] = {{"code", static_cast<int>(reason.code())},
                      {"reason", ErrorReason(reason)},
                      {"message", std::string(reason.message())},
                      {"metadata", std::move(metadata)}};
  }
  // Messages may quote bytes that are no UTF-8, from a device or a path.
  return JournalLine(json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

absl::StatusOr<StoredState> ReadState(const JsonReader& reader) {
  ASSIGN_OR_RETURN(RunState state, ParseRunState(reader.String("state")));
  StoredState stored{state, absl::OkStatus(), reader.String("at")};
  if (reader.Has("reason")) {
    JsonReader reason = reader.Object("reason");
    ErrorMetadata metadata;
    for (const auto& [key, value] : reason.Value("metadata").items()) {
      if (value.is_string()) metadata.emplace_back(key, value.get<std::string>());
    }
    stored.reason = Error(static_cast<absl::StatusCode>(reason.Int("code", 1, 16)),
                          reason.String("reason"), reason.String("message"), metadata);
  }
  return stored;
}

}  // namespace

RunFolder::RunFolder(Env& env, std::string path, RunHeader header)
    : env_(env), path_(std::move(path)), header_(std::move(header)) {}

absl::StatusOr<std::unique_ptr<RunFolder>> RunFolder::Create(Env& env, const std::string& path,
                                                             const RunHeader& header,
                                                             std::string_view rig_text) {
  ASSIGN_OR_RETURN(std::string header_json, RunHeaderToJson(header));
  for (const char* folder : kImageFolders) {
    RETURN_IF_ERROR(env.CreateDirectories(Join(path, folder)));
  }
  RETURN_IF_ERROR(env.WriteFile(Join(path, kRigFile), rig_text));
  RETURN_IF_ERROR(env.WriteFile(Join(path, kJournalFile), StartLine(header.id)));
  RETURN_IF_ERROR(env.SyncDirectory(path));
  RETURN_IF_ERROR(env.WriteFile(Join(path, kRunFile), header_json));
  RETURN_IF_ERROR(env.SyncDirectory(path));
  RETURN_IF_ERROR(env.SyncDirectory(std::filesystem::path(path).parent_path().string()));
  ASSIGN_OR_RETURN(auto folder, Open(env, path));
  RETURN_IF_ERROR(folder->PrepareToAppend());
  return folder;
}

absl::StatusOr<std::unique_ptr<RunFolder>> RunFolder::Open(Env& env, const std::string& path) {
  std::string file = Join(path, kRunFile);
  ASSIGN_OR_RETURN(std::string text, env.ReadFile(file));
  ASSIGN_OR_RETURN(RunHeader header, RunHeaderFromJson(text, file));
  auto folder = std::unique_ptr<RunFolder>(new RunFolder(env, path, std::move(header)));
  RETURN_IF_ERROR(folder->Load());
  return folder;
}

absl::Status RunFolder::Load() {
  std::string file = Join(path_, kJournalFile);
  ASSIGN_OR_RETURN(std::string text, env_.ReadFile(file));
  MutexLock append_lock(&append_mutex_);
  MutexLock lock(&mutex_);
  state_.at = header_.created_at;
  JournalScan scan = ScanJournal(text, file, [this](std::string_view payload) {
    mutex_.AssertHeld();
    return TakeEntry(payload);
  });
  journal_bytes_ = scan.good_bytes;
  torn_bytes_ = scan.torn_bytes;
  damage_ = scan.damage;
  if (damage_.ok() && scan.good_bytes == 0) {
    damage_ = Error(absl::StatusCode::kDataLoss, "JOURNAL_CORRUPT",
                    absl::StrCat(file, ": line 1 at byte 0: there is no good line in it"),
                    {{"file", file}, {"line", "1"}, {"offset", "0"}});
  }
  if (!IsTerminal(state_.state) && state_.state != RunState::kInterrupted) {
    state_.reason = Error(absl::StatusCode::kAborted, "DAEMON_ENDED",
                          absl::StrCat("the daemon ended while the run was ",
                                       RunStateName(state_.state), "; resume continues it"));
    state_.state = RunState::kInterrupted;
  }
  return absl::OkStatus();
}

absl::Status RunFolder::TakeEntry(std::string_view payload) {
  ASSIGN_OR_RETURN(Json json, ParseJson(payload, "entry"));
  JsonReader reader(json, "entry");
  std::string type = reader.String("type");
  if (type == "shot") {
    ShotRecord record = ReadShotRecord(reader.Object("record"));
    RETURN_IF_ERROR(reader.status());
    if (by_id_.count(record.shot.id) > 0) {
      return Error(absl::StatusCode::kAlreadyExists, "SHOT_DUPLICATE",
                   absl::StrCat("shot ", record.shot.id, " has a record already"));
    }
    TakeRecord(std::move(record));
  } else if (type == "state") {
    ASSIGN_OR_RETURN(StoredState stored, ReadState(reader));
    RETURN_IF_ERROR(reader.status());
    state_ = std::move(stored);
  } else if (type == "lost") {
    std::set<uint64_t> shot_ids;
    for (const Json& id : reader.Value("shots")) {
      if (!id.is_number_unsigned() || by_id_.count(id.get<uint64_t>()) == 0) {
        reader.ErrorAt("shots", absl::StrCat("names ", id.dump(), ", which has no record"));
        break;
      }
      shot_ids.insert(id.get<uint64_t>());
    }
    RETURN_IF_ERROR(reader.status());
    Retract(shot_ids);
  } else if (type == "journal") {
    reader.Int("version", kJournalVersion, kJournalVersion);
    std::string run = reader.String("run");
    if (run != header_.id) {
      reader.ErrorAt("run", absl::StrCat("is '", run, "', must be '", header_.id, "'"));
    }
    RETURN_IF_ERROR(reader.status());
  } else {
    reader.ErrorAt("type", absl::StrCat("is '", type, "', must be journal, state, shot or lost"));
  }
  return reader.status();
}

void RunFolder::Retract(const std::set<uint64_t>& shot_ids) {
  for (uint64_t id : shot_ids) {
    const auto it = by_id_.find(id);
    const ShotRecord& record = records_[it->second];
    --totals_.records;
    totals_.bytes -= record.bytes;
    totals_.retakes -= static_cast<uint64_t>(record.attempts - 1);
    if (record.shot.kind == ShotKind::kBasis && record.checks.nothing_seen) --totals_.nothing_seen;
    given_up_.insert(it->second);
    by_id_.erase(it);
  }
  last_reference_.reset();
  for (size_t i = 0; i < records_.size(); ++i) {
    if (records_[i].shot.kind == ShotKind::kReference && given_up_.count(i) == 0)
      last_reference_ = i;
  }
}

void RunFolder::TakeRecord(ShotRecord record) {
  ++totals_.records;
  totals_.bytes += record.bytes;
  totals_.retakes += static_cast<uint64_t>(record.attempts - 1);
  if (record.shot.kind == ShotKind::kBasis && record.checks.nothing_seen) ++totals_.nothing_seen;
  if (record.shot.kind == ShotKind::kReference) last_reference_ = records_.size();
  by_id_.emplace(record.shot.id, records_.size());
  records_.push_back(std::move(record));
}

absl::Status RunFolder::PrepareToAppend() {
  MutexLock append_lock(&append_mutex_);
  MutexLock lock(&mutex_);
  if (appending_) return absl::OkStatus();
  if (!damage_.ok()) {
    return Annotate(damage_, absl::StrCat("run ", header_.id, " cannot be continued"));
  }
  std::string file = Join(path_, kJournalFile);
  if (torn_bytes_ > 0) {
    spdlog::warn("run {}: cutting {} bytes of a torn append off the journal at byte {}", header_.id,
                 torn_bytes_, journal_bytes_);
    RETURN_IF_ERROR(env_.Truncate(file, journal_bytes_));
    torn_bytes_ = 0;
  }
  RETURN_IF_ERROR(RemoveLeftovers());
  ASSIGN_OR_RETURN(journal_, env_.OpenAppend(file));
  appending_ = true;
  return absl::OkStatus();
}

absl::StatusOr<std::vector<RunFolder::Lost>> RunFolder::FindLost() const {
  std::vector<Lost> lost;
  for (ShotRecord& record : Records(0, UINT64_MAX)) {
    auto size = env_.FileSize(Join(path_, record.file));
    if (size.ok() && *size == record.bytes) continue;
    if (!size.ok() && !absl::IsNotFound(size.status())) return size.status();
    std::optional<uint64_t> bytes;
    if (size.ok()) bytes = *size;
    lost.push_back({std::move(record), bytes});
  }
  return lost;
}

absl::Status RunFolder::CheckImages() const {
  ASSIGN_OR_RETURN(std::vector<Lost> lost, FindLost());
  if (lost.empty()) return absl::OkStatus();
  return Error(
      absl::StatusCode::kDataLoss, "IMAGES_LOST",
      absl::StrCat(lost.size(),
                   " images are gone or have been cut short since they were "
                   "stored, the first is ",
                   lost[0].record.file,
                   ". They are taken again if the daemon is restarted and the run resumed"),
      {{"images", absl::StrCat(lost.size())}, {"file", lost[0].record.file}});
}

absl::Status RunFolder::RetractLost() {
  ASSIGN_OR_RETURN(std::vector<Lost> lost, FindLost());
  if (lost.empty()) return absl::OkStatus();
  std::set<uint64_t> shot_ids;
  for (const Lost& l : lost) {
    spdlog::warn("run {}: {} {}; its shot is taken again", header_.id, l.record.file,
                 l.bytes
                     ? absl::StrCat("has ", *l.bytes, " bytes, its record says ", l.record.bytes)
                     : "is gone");
    shot_ids.insert(l.record.shot.id);
  }
  MutexLock append_lock(&append_mutex_);
  RETURN_IF_ERROR(AppendDurably(LostLine(shot_ids)));
  {
    MutexLock lock(&mutex_);
    Retract(shot_ids);
  }
  for (const Lost& l : lost) {
    if (l.bytes) RETURN_IF_ERROR(env_.Remove(Join(path_, l.record.file)));
  }
  return absl::OkStatus();
}

absl::Status RunFolder::RemoveLeftovers() {
  for (ShotKind kind : {ShotKind::kBasis, ShotKind::kDark, ShotKind::kReference}) {
    std::string folder = Join(path_, ShotKindName(kind));
    RETURN_IF_ERROR(
        env_.CreateDirectories(folder));  // somebody may have removed it with what was in it
    ASSIGN_OR_RETURN(std::vector<std::string> names, env_.List(folder));
    std::vector<std::string> recorded;
    for (const auto& [id, position] : by_id_) {
      if (records_[position].shot.kind == kind) recorded.push_back(records_[position].file);
    }
    std::sort(recorded.begin(), recorded.end());
    bool removed = false;
    for (const std::string& name : names) {
      // What else lies there is somebody's, not ours.
      if (!name.ends_with(kImageSuffix) && !name.ends_with(kTemporarySuffix)) continue;
      if (std::binary_search(recorded.begin(), recorded.end(), Join(ShotKindName(kind), name)))
        continue;
      if (ErrorReason(env_.FileSize(Join(folder, name)).status()) == "FILE_NOT_REGULAR") continue;
      spdlog::info("run {}: removing {}/{}, which has no record", header_.id, ShotKindName(kind),
                   name);
      RETURN_IF_ERROR(env_.Remove(Join(folder, name)));
      removed = true;
    }
    if (removed) RETURN_IF_ERROR(env_.SyncDirectory(folder));
  }
  ASSIGN_OR_RETURN(std::vector<std::string> names, env_.List(path_));
  for (const std::string& name : names) {
    if (name.ends_with(kTemporarySuffix)) RETURN_IF_ERROR(env_.Remove(Join(path_, name)));
  }
  return absl::OkStatus();
}

absl::Status RunFolder::AppendDurably(std::string_view lines) {
  std::string file = Join(path_, kJournalFile);
  if (journal_ == nullptr) {
    return Error(absl::StatusCode::kFailedPrecondition, "RUN_READ_ONLY",
                 absl::StrCat("run ", header_.id, " is not open for appending"),
                 {{"run", header_.id}});
  }
  if (journal_dirty_) {
    RETURN_IF_ERROR(env_.Truncate(file, journal_bytes_));
    journal_dirty_ = false;
  }
  absl::Status status = Failpoint("store.before_journal_append");
  if (status.ok()) status = journal_->Append(lines);
  if (status.ok()) status = Failpoint("store.after_journal_append");
  if (status.ok()) status = journal_->Sync();
  if (status.ok()) {
    journal_bytes_ += lines.size();
    return status;
  }
  // Part of it may be there, or all of it but perhaps not durable: as if it had not been.
  journal_dirty_ = true;
  if (env_.Truncate(file, journal_bytes_).ok()) journal_dirty_ = false;
  return status;
}

absl::Status RunFolder::AppendRecords(const std::vector<ShotRecord>& records) {
  MutexLock append_lock(&append_mutex_);
  std::string lines;
  for (size_t i = 0; i < records.size(); ++i) {
    uint64_t id = records[i].shot.id;
    bool twice = std::any_of(records.begin(), records.begin() + static_cast<ptrdiff_t>(i),
                             [id](const ShotRecord& r) { return r.shot.id == id; });
    if (twice || HasRecord(id)) {
      return Error(absl::StatusCode::kAlreadyExists, "SHOT_DUPLICATE",
                   absl::StrCat("run ", header_.id, ": shot ", id, " has a record already"),
                   {{"run", header_.id}, {"shot", absl::StrCat(id)}});
    }
    lines += RecordLine(records[i]);
  }
  RETURN_IF_ERROR(AppendDurably(lines));
  MutexLock lock(&mutex_);
  for (const ShotRecord& record : records) TakeRecord(record);
  return absl::OkStatus();
}

absl::Status RunFolder::AppendState(RunState state, const absl::Status& reason, WallTime at) {
  StoredState stored{state, reason, FormatUtc(at)};
  MutexLock append_lock(&append_mutex_);
  RETURN_IF_ERROR(AppendDurably(StateLine(state, reason, stored.at)));
  MutexLock lock(&mutex_);
  state_ = std::move(stored);
  return absl::OkStatus();
}

absl::Status RunFolder::damage() const {
  MutexLock lock(&mutex_);
  return damage_;
}

uint64_t RunFolder::torn_bytes() const {
  MutexLock lock(&mutex_);
  return torn_bytes_;
}

bool RunFolder::appending() const {
  MutexLock lock(&mutex_);
  return appending_;
}

StoredState RunFolder::state() const {
  MutexLock lock(&mutex_);
  return state_;
}

RunTotals RunFolder::totals() const {
  MutexLock lock(&mutex_);
  return totals_;
}

std::vector<ShotRecord> RunFolder::Records(uint64_t first, uint64_t most) const {
  MutexLock lock(&mutex_);
  std::vector<ShotRecord> records;
  for (uint64_t i = first; i < records_.size() && i - first < most; ++i) {
    if (given_up_.count(i) == 0) records.push_back(records_[i]);
  }
  return records;
}

uint64_t RunFolder::positions() const {
  MutexLock lock(&mutex_);
  return records_.size();
}

bool RunFolder::HasRecord(uint64_t shot_id) const {
  MutexLock lock(&mutex_);
  return by_id_.count(shot_id) > 0;
}

std::optional<ShotRecord> RunFolder::LastReference() const {
  MutexLock lock(&mutex_);
  if (!last_reference_) return std::nullopt;
  return records_[*last_reference_];
}

uint64_t RunFolder::count() const { return totals().records; }

absl::StatusOr<ShotRecord> RunFolder::Find(uint64_t shot_id) const {
  MutexLock lock(&mutex_);
  auto it = by_id_.find(shot_id);
  if (it == by_id_.end()) {
    return Error(absl::StatusCode::kNotFound, "SHOT_NOT_DONE",
                 absl::StrCat("shot ", shot_id, " of run ", header_.id, " has no record yet"),
                 {{"shot", absl::StrCat(shot_id)}, {"run", header_.id}});
  }
  return records_[it->second];
}

std::string RunFolder::ImageFile(ShotKind kind, uint64_t shot_id) {
  return absl::StrFormat("%s/%06d.exr", ShotKindName(kind), shot_id);
}

absl::StatusOr<std::string> RunFolder::PathOf(std::string_view relative) const {
  std::filesystem::path path(relative);
  bool inside =
      !relative.empty() && path.is_relative() && relative.find('\0') == std::string_view::npos;
  for (const auto& part : path) inside = inside && part != ".." && part != ".";
  if (!inside) {
    return Error(absl::StatusCode::kInvalidArgument, "FILE_NAME",
                 absl::StrCat("'", relative, "' is no file of a run; want a path below its folder"),
                 {{"file", std::string(relative)}});
  }
  return Join(path_, relative);
}

absl::StatusOr<std::vector<FolderFile>> RunFolder::ListFiles() const {
  std::vector<FolderFile> files;
  auto add = [&](const std::string& relative) -> absl::Status {
    if (relative.ends_with(kTemporarySuffix)) return absl::OkStatus();
    // Clients cannot be told of a name that is no text; none of ours is like that.
    if (CleanUtf8(relative) != relative) return absl::OkStatus();
    auto size = env_.FileSize(Join(path_, relative));
    // Removed meanwhile, or a folder of somebody's.
    if (absl::IsNotFound(size.status()) || ErrorReason(size.status()) == "FILE_NOT_REGULAR")
      return absl::OkStatus();
    RETURN_IF_ERROR(size.status());
    files.push_back({relative, *size});
    return absl::OkStatus();
  };
  ASSIGN_OR_RETURN(std::vector<std::string> top, env_.List(path_));
  for (const std::string& name : top) {
    bool folder = std::find(std::begin(kImageFolders), std::end(kImageFolders), name) !=
                  std::end(kImageFolders);
    if (!folder) {
      RETURN_IF_ERROR(add(name));
      continue;
    }
    ASSIGN_OR_RETURN(std::vector<std::string> images, env_.List(Join(path_, name)));
    for (const std::string& image : images) RETURN_IF_ERROR(add(Join(name, image)));
  }
  return files;
}

}  // namespace lightstage
