// One run on disk: DIR/runs/<id>/ with run.json, rig.toml, journal, basis/ dark/ reference/, and at the end manifest.json and *.lp
// (docs/DATASET.md).
//
// The journal is the truth: a shot is done when its record's line is durable. The folder is first open for reading; PrepareToAppend()
// cleans up what a crash left and opens it for writing. All methods are thread-safe.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/env.h"
#include "base/mutex.h"
#include "daemon/capture/program.h"
#include "daemon/engine/run_state.h"
#include "daemon/store/run_header.h"
#include "dataset/shot.h"

namespace lightstage {

// What the journal says of the run as a whole.
struct StoredState {
  RunState state = RunState::kRunning;
  absl::Status reason;  // why it is held, failed or interrupted
  std::string at;       // RFC 3339, UTC
};

struct RunTotals {
  uint64_t records = 0;
  uint64_t bytes = 0;         // of the images
  uint64_t retakes = 0;       // attempts beyond the first
  uint64_t nothing_seen = 0;  // basis shots whose light was not seen
};

struct FolderFile {
  std::string path;  // relative to the folder
  uint64_t bytes = 0;
};

class RunFolder final : public Results {
 public:
  // Writes a new run; `path` must not exist. The run exists once run.json does, the last file written.
  static absl::StatusOr<std::unique_ptr<RunFolder>> Create(Env& env, const std::string& path,
                                                           const RunHeader& header,
                                                           std::string_view rig_text);
  // Loads a run without changing it. A state that is not final means that the daemon died: it reads as INTERRUPTED. A damaged
  // journal still loads, see damage().
  static absl::StatusOr<std::unique_ptr<RunFolder>> Open(Env& env, const std::string& path);

  const RunHeader& header() const { return header_; }
  const std::string& path() const { return path_; }
  Env& env() const { return env_; }

  // DATA_LOSS / JOURNAL_CORRUPT naming line and offset if the journal is damaged other than by a crash; OK otherwise.
  absl::Status damage() const;
  // Bytes after the journal's last good line when it was opened: a crash's torn append.
  uint64_t torn_bytes() const;

  // Cuts off a torn journal tail and removes temporary files and EXR files without a record (their shots are taken again); both are
  // logged. damage() if there is any: nothing is appended to a journal that cannot be trusted.
  absl::Status PrepareToAppend();
  bool appending() const;

  // Gives up every record whose image is not there any more or has another size (and removes that): logged and journaled, so that its
  // shot is taken again. PrepareToAppend() comes before.
  absl::Status RetractLost();
  // DATA_LOSS / IMAGES_LOST naming the first if such records are there.
  absl::Status CheckImages() const;

  // Appends the records of shots whose files are durable, with one sync. If this fails nothing has been appended. ALREADY_EXISTS /
  // SHOT_DUPLICATE if a shot has a record.
  absl::Status AppendRecords(const std::vector<ShotRecord>& records);
  absl::Status AppendState(RunState state, const absl::Status& reason, WallTime at);

  StoredState state() const;
  RunTotals totals() const;
  // The records at the positions [first, first + most), in the order in which they became durable. A record keeps its position for
  // ever; those that were given up are left out.
  std::vector<ShotRecord> Records(uint64_t first, uint64_t most) const;
  // How many positions there are, those of records that were given up among them.
  uint64_t positions() const;
  bool HasRecord(uint64_t shot_id) const;
  // The last stored reference shot.
  std::optional<ShotRecord> LastReference() const;

  // Results.
  uint64_t count() const override;
  absl::StatusOr<ShotRecord> Find(uint64_t shot_id) const override;

  // "basis/000123.exr".
  static std::string ImageFile(ShotKind kind, uint64_t shot_id);
  // The absolute path of a file named relative to the folder. INVALID_ARGUMENT / FILE_NAME if it would lead out of it.
  absl::StatusOr<std::string> PathOf(std::string_view relative) const;
  // All files there are now, temporary ones apart, sorted.
  absl::StatusOr<std::vector<FolderFile>> ListFiles() const;

 private:
  RunFolder(Env& env, std::string path, RunHeader header);

  absl::Status Load();
  struct Lost {
    ShotRecord record;
    std::optional<uint64_t> bytes;  // there are; none: the file is gone
  };
  absl::StatusOr<std::vector<Lost>> FindLost() const;
  absl::Status TakeEntry(std::string_view payload) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Retract(const std::set<uint64_t>& shot_ids) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void TakeRecord(ShotRecord record) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status RemoveLeftovers() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Durable append, or nothing.
  absl::Status AppendDurably(std::string_view lines) ABSL_EXCLUSIVE_LOCKS_REQUIRED(append_mutex_);

  Env& env_;
  const std::string path_;
  const RunHeader header_;

  // Held during disk writes, so that readers (mutex_) never wait for a disk. Before mutex_.
  mutable Mutex append_mutex_ ABSL_ACQUIRED_BEFORE(mutex_);
  std::unique_ptr<AppendFile> journal_ ABSL_GUARDED_BY(append_mutex_);
  uint64_t journal_bytes_ ABSL_GUARDED_BY(append_mutex_) = 0;  // durable ones
  bool journal_dirty_ ABSL_GUARDED_BY(append_mutex_) =
      false;  // an append failed: cut back before the next

  mutable Mutex mutex_;
  absl::Status damage_ ABSL_GUARDED_BY(mutex_);
  uint64_t torn_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  bool appending_ ABSL_GUARDED_BY(mutex_) = false;
  StoredState state_ ABSL_GUARDED_BY(mutex_);
  RunTotals totals_ ABSL_GUARDED_BY(mutex_);
  std::vector<ShotRecord> records_ ABSL_GUARDED_BY(mutex_);  // by position
  std::set<size_t> given_up_ ABSL_GUARDED_BY(mutex_);        // positions
  std::unordered_map<uint64_t, size_t> by_id_ ABSL_GUARDED_BY(mutex_);
  std::optional<size_t> last_reference_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage
