// The life of runs: puts program, engine, pipeline and folder together, one run at a time, and knows those of the past.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "daemon/capture/estimate.h"
#include "daemon/capture/plan.h"
#include "daemon/engine/engine.h"
#include "daemon/store/data_directory.h"
#include "daemon/store/pipeline.h"
#include "daemon/store/run_folder.h"

namespace lightstage {

// One run as its user sees it.
struct RunView {
  std::string id;
  std::string name;
  std::string directory;
  std::string created_at, ended_at;  // RFC 3339, UTC; ended_at is empty while it goes on
  std::string plan_json;
  RunState state = RunState::kInterrupted;
  absl::Status reason;
  uint64_t total_shots = 0, done_shots = 0, retakes = 0, nothing_seen = 0, stored_bytes = 0;
  Pose pose;
  double shots_per_second = 0, remaining_seconds = 0;  // 0 unless RUNNING
};

// Thread-safe.
class RunManager {
 public:
  // Plans are stored as text in the form that the network contract gives them (daemon/rpc), which this room does not know.
  struct PlanText {
    std::function<absl::StatusOr<std::string>(const Plan&)> write;
    std::function<absl::StatusOr<Plan>(const std::string&)> read;
  };

  // All references outlive the manager.
  RunManager(Rig& rig, const RigFacts& facts, DataDirectory& data, Env& env, PlanText plan_text);
  ~RunManager();  // Shutdown()

  absl::StatusOr<uint64_t> FreeBytes() const;
  // daemon/store/room.h, for the data directory.
  absl::Status CheckRoom(uint64_t bytes) const;

  // The new run's id. INVALID_ARGUMENT as EstimatePlan(); RESOURCE_EXHAUSTED / DISK_TOO_SMALL; FAILED_PRECONDITION as
  // Rig::Acquire().
  absl::StatusOr<std::string> Start(const Plan& plan, std::string name);
  // NOT_FOUND / RUN_NOT_FOUND; FAILED_PRECONDITION / RUN_STATE.
  absl::Status Pause(const std::string& id);
  // An interrupted run also: RIG_CHANGED if the rig file is not the one it was begun with; DATA_LOSS if its journal is damaged.
  absl::Status Resume(const std::string& id);
  absl::Status Cancel(const std::string& id);

  absl::StatusOr<RunView> Get(const std::string& id);
  absl::StatusOr<std::vector<RunView>> List();  // newest first
  absl::StatusOr<std::shared_ptr<const RunFolder>> Folder(const std::string& id);
  // Read from disk now, unless the run is being captured: for those who check what is there.
  absl::StatusOr<std::shared_ptr<const RunFolder>> Reread(const std::string& id);

  // Id of the run that uses the rig; empty if none does.
  std::string active() const;
  // Holds the active run, if any, because of `reason`.
  void HoldActive(const absl::Status& reason);
  // True unless a run is capturing: what needs the rig at rest may go ahead.
  bool at_rest() const;

  // Interrupts the active run and waits for it. What would begin one afterwards is refused: UNAVAILABLE / DAEMON_ENDING.
  void Shutdown();

 private:
  struct Active {
    std::string id;
    // Shared with whoever reads a run that is being captured; it may outlive the run's activity.
    std::shared_ptr<RunFolder> folder;
    std::unique_ptr<Program> program;
    std::unique_ptr<Engine> engine;
    std::unique_ptr<Pipeline> pipeline;
    // For the rate: when it was last set running, and how much it had then.
    absl::Time running_since;
    uint64_t done_then = 0;
    std::thread thread;
  };

  // Takes the rig and starts the engine on `folder`.
  absl::Status Launch(std::shared_ptr<RunFolder> folder, const Plan& plan,
                      std::optional<Engine::Resumption> resumption);
  absl::Status CheckOpenLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(launch_mutex_);
  void RunActive(Active& active);
  Engine::Resumption ResumptionOf(const RunFolder& folder) const;
  absl::Status CompareReference(const RunFolder& folder, const ShotRecord& stored,
                                const RawShot& raw) const;
  std::shared_ptr<Active> CurrentRun() const;  // or the last one; null before the first
  std::shared_ptr<Active> ActiveRun(const std::string& id) const;
  RunView ViewOf(const RunFolder& folder) const;
  absl::StatusOr<std::shared_ptr<RunFolder>> OpenFolder(const std::string& id);
  // What is known of a past run is not so any more.
  void ForgetLocked(const std::string& id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  Rig& rig_;
  const RigFacts& facts_;
  DataDirectory& data_;
  Env& env_;
  const PlanText plan_text_;

  Mutex launch_mutex_;  // before mutex_: one start, resume or cancel of a past run at a time
  bool closing_ ABSL_GUARDED_BY(launch_mutex_) = false;
  mutable Mutex mutex_;
  std::shared_ptr<Active> active_
      ABSL_GUARDED_BY(mutex_);  // shared: calls on it may outlast the run
  std::map<std::string, RunView> past_ ABSL_GUARDED_BY(mutex_);  // what does not change any more
  std::shared_ptr<RunFolder> last_opened_
      ABSL_GUARDED_BY(mutex_);  // of a past run: reading one run means many calls
  uint64_t forgotten_ ABSL_GUARDED_BY(mutex_) = 0;  // tells a reader that what it read may be old
};

}  // namespace lightstage
