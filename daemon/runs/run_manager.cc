#include "daemon/runs/run_manager.h"

#include <cmath>

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "daemon/capture/check_plan.h"
#include "daemon/develop/develop.h"
#include "daemon/store/finish.h"
#include "daemon/store/layout.h"
#include "daemon/store/room.h"
#include "dataset/basis_exr.h"
#include "dataset/sha256.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

// How much a reference taken anew may differ, as the sum of absolute differences over the greater sum of values, of means over blocks: that
// is well above what noise leaves of a block, and below what a bumped camera or another exposure does.
constexpr double kReferenceTolerance = 0.05;
constexpr int kReferenceBlock = 8;

double BlockDifference(const Image& a, const Image& b) {
  double difference = 0, total_a = 0, total_b = 0;
  for (int y = 0; y < a.height(); y += kReferenceBlock) {
    for (int x = 0; x < a.width(); x += kReferenceBlock) {
      double sum_a = 0, sum_b = 0;
      for (int v = y; v < std::min(y + kReferenceBlock, a.height()); ++v) {
        for (int u = x; u < std::min(x + kReferenceBlock, a.width()); ++u) {
          for (int c = 0; c < a.channels(); ++c) {
            sum_a += a.at(u, v, c);
            sum_b += b.at(u, v, c);
          }
        }
      }
      difference += std::abs(sum_a - sum_b);
      total_a += std::abs(sum_a);
      total_b += std::abs(sum_b);
    }
  }
  // Of the brighter one, so that a black picture differs from every other.
  double total = std::max(total_a, total_b);
  return total > 0 ? difference / total : 0;
}

absl::Status NotActive(const std::string& id, RunState state, std::string_view what) {
  return Error(absl::StatusCode::kFailedPrecondition, "RUN_STATE",
               absl::StrFormat("cannot %s run %s: it is %s", std::string(what), id,
                               std::string(RunStateName(state))),
               {{"run", id}, {"state", std::string(RunStateName(state))}});
}

}  // namespace

RunManager::RunManager(Rig& rig, const RigFacts& facts, DataDirectory& data, Env& env,
                       PlanText plan_text)
    : rig_(rig), facts_(facts), data_(data), env_(env), plan_text_(std::move(plan_text)) {}

RunManager::~RunManager() { Shutdown(); }

absl::StatusOr<uint64_t> RunManager::FreeBytes() const { return env_.FreeBytes(data_.path()); }

absl::Status RunManager::CheckRoom(uint64_t bytes) const {
  return lightstage::CheckRoom(env_, data_.path(), bytes);
}

// ---- Starting

absl::StatusOr<std::string> RunManager::Start(const Plan& plan, std::string name) {
  ASSIGN_OR_RETURN(ResolvedPlan resolved, ResolvePlan(plan, facts_));
  ASSIGN_OR_RETURN(Estimate estimate, EstimatePlan(resolved.plan, facts_));
  if (name.size() > 200) {
    return Error(
        absl::StatusCode::kInvalidArgument, "NAME_TOO_LONG",
        absl::StrFormat("the run's name has %d characters, at most 200 are possible", name.size()),
        {{"length", absl::StrCat(name.size())}});
  }
  RETURN_IF_ERROR(CheckRoom(static_cast<uint64_t>(estimate.bytes)));

  MutexLock launching(&launch_mutex_);
  RETURN_IF_ERROR(CheckOpenLocked());
  RETURN_IF_ERROR(rig_.Acquire(RigUse::kRun));
  const CameraConfig& camera = facts_.camera_config;
  RunHeader header;
  header.name = std::move(name);
  header.rig_name = rig_.file().name;
  header.geometry = facts_.geometry;
  header.width = camera.width;
  header.height = camera.height;
  header.channels = SamplesPerPixel(camera.format) == 3 || IsBayer(camera.format) ? 3 : 1;
  header.compression = facts_.compression;
  header.expected_shots = estimate.shots + estimate.extra_shots;
  absl::Status launched;
  std::string id;
  auto plan_json = plan_text_.write(resolved.plan);
  if (plan_json.ok()) {
    header.plan_json = *plan_json;
    auto folder = data_.CreateRun(header, rig_.file().text, rig_.WallNow());
    if (folder.ok()) {
      id = (*folder)->header().id;
      launched = Launch(*std::move(folder), resolved.plan, std::nullopt);
    } else {
      launched = folder.status();
    }
  } else {
    launched = plan_json.status();
  }
  if (!launched.ok()) {
    rig_.Release();
    return launched;
  }
  return id;
}

absl::Status RunManager::CheckOpenLocked() const {
  if (!closing_) return absl::OkStatus();
  return Error(absl::StatusCode::kUnavailable, "DAEMON_ENDING", "the daemon is going down");
}

absl::Status RunManager::Launch(std::shared_ptr<RunFolder> folder, const Plan& plan,
                                std::optional<Engine::Resumption> resumption) {
  const RigFile& file = rig_.file();
  ASSIGN_OR_RETURN(ExrCompression compression, ParseExrCompression(folder->header().compression));
  RETURN_IF_ERROR(folder->AppendState(RunState::kRunning, absl::OkStatus(), rig_.WallNow()));

  auto active = std::make_shared<Active>();
  Active* a = active.get();
  a->id = folder->header().id;
  a->folder = std::move(folder);
  a->program = MakeProgram(plan);
  a->running_since = absl::Now();
  a->done_then = a->folder->count();

  Engine::Hooks hooks;
  hooks.state_changed = [this, a](RunState state, const absl::Status& reason) {
    if (state == RunState::kPausing || state == RunState::kCancelling) return;  // on the way
    {
      MutexLock lock(&mutex_);
      a->running_since = absl::Now();
      a->done_then = a->folder->count();
    }
    absl::Status kept = a->folder->AppendState(state, reason, rig_.WallNow());
    // The records are what a run is made of; a lost state is found INTERRUPTED at the next start.
    if (!kept.ok())
      spdlog::error("run {}: state {} not recorded: {}", a->id, RunStateName(state),
                    MessageOf(kept));
  };
  hooks.finish = [a] { return Finish(*a->folder); };
  a->engine = std::make_unique<Engine>(
      rig_, facts_, *a->program, *a->folder,
      [folder = a->folder.get()](uint64_t id) { return folder->HasRecord(id); },
      std::move(resumption), std::move(hooks));
  a->pipeline = std::make_unique<Pipeline>(
      *a->folder, [&file](const RawShot& raw) { return Develop(raw, file.develop, file.geometry); },
      PipelineOptions{file.develop.workers, file.store.queue_shots, compression},
      [a](const ShotOutcome& outcome) {
        a->engine->OnOutcome(outcome.shot_id, outcome.record.status());
      });

  std::shared_ptr<Active> before;
  {
    MutexLock lock(&mutex_);
    before = std::exchange(active_, active);
    ForgetLocked(a->id);
    // Ended runs are read from disk again: what is told of them is what is there.
    if (before) ForgetLocked(before->id);
  }
  if (before) before->thread.join();  // it has released the rig, so it has all but ended
  spdlog::info("run {}: {} shots", a->id, a->folder->header().expected_shots);
  a->thread = std::thread([this, active] { RunActive(*active); });
  return absl::OkStatus();
}

void RunManager::RunActive(Active& active) {
  active.engine->Run(*active.pipeline);
  rig_.Release();
}

std::shared_ptr<RunManager::Active> RunManager::CurrentRun() const {
  MutexLock lock(&mutex_);
  return active_;
}

std::shared_ptr<RunManager::Active> RunManager::ActiveRun(const std::string& id) const {
  auto active = CurrentRun();
  return active && active->id == id ? active : nullptr;
}

// ---- Going on

absl::Status RunManager::Pause(const std::string& id) {
  if (auto active = ActiveRun(id)) return active->engine->Pause();
  ASSIGN_OR_RETURN(RunView run, Get(id));
  return NotActive(id, run.state, "pause");
}

absl::Status RunManager::Resume(const std::string& id) {
  if (auto active = ActiveRun(id);
      active && active->engine->progress().state != RunState::kInterrupted)
    return active->engine->Resume();
  MutexLock launching(&launch_mutex_);
  RETURN_IF_ERROR(CheckOpenLocked());
  {
    MutexLock lock(&mutex_);
    ForgetLocked(id);  // its journal may have been mended by hand
  }
  ASSIGN_OR_RETURN(RunView run, Get(id));
  if (ErrorReason(run.reason) == "JOURNAL_CORRUPT") {
    return Annotate(run.reason,
                    absl::StrCat("run ", id,
                                 " cannot be continued: its journal is damaged (runs verify "
                                 "lists all damage; docs/DATASET.md says how to mend it)"));
  }
  if (!NextState(run.state, RunEvent::kResume).ok()) return NotActive(id, run.state, "resume");
  ASSIGN_OR_RETURN(std::unique_ptr<RunFolder> folder, data_.OpenRun(id));
  ASSIGN_OR_RETURN(std::string rig_text,
                   env_.ReadFile(absl::StrCat(folder->path(), "/", kRigFile)));
  if (rig_text != rig_.file().text) {
    return Error(absl::StatusCode::kFailedPrecondition, "RIG_CHANGED",
                 absl::StrFormat("run %s was begun with another rig file; start the daemon with "
                                 "--rig %s/%s to resume it",
                                 id, folder->path(), kRigFile),
                 {{"run", id}, {"rig_file", absl::StrCat(folder->path(), "/", kRigFile)}});
  }
  ASSIGN_OR_RETURN(Plan plan, plan_text_.read(folder->header().plan_json));
  RETURN_IF_ERROR(rig_.Acquire(RigUse::kRun));
  absl::Status launched = folder->PrepareToAppend();
  if (launched.ok()) launched = folder->RetractLost();
  if (launched.ok()) {
    Engine::Resumption resumption = ResumptionOf(*folder);
    launched = Launch(std::move(folder), plan, std::move(resumption));
  }
  if (!launched.ok()) {
    rig_.Release();
    MutexLock lock(&mutex_);
    ForgetLocked(id);  // its journal may have been cut, and records given up
  }
  return launched;
}

Engine::Resumption RunManager::ResumptionOf(const RunFolder& folder) const {
  Engine::Resumption resumption;
  std::optional<ShotRecord> reference = folder.LastReference();
  // Without reference frames the last basis image that shows something does.
  const std::vector<ShotRecord> records = folder.Records(0, UINT64_MAX);
  for (auto it = records.rbegin(); !reference && it != records.rend(); ++it) {
    if (it->shot.kind == ShotKind::kBasis && !it->checks.nothing_seen) reference = *it;
  }
  if (!reference) return resumption;
  resumption.reference = reference->shot;
  resumption.compare = [this, &folder = folder, stored = *reference](const RawShot& raw) {
    return CompareReference(folder, stored, raw);
  };
  return resumption;
}

absl::Status RunManager::CompareReference(const RunFolder& folder, const ShotRecord& stored,
                                          const RawShot& raw) const {
  ASSIGN_OR_RETURN(Developed now, Develop(raw, rig_.file().develop, rig_.file().geometry));
  auto bytes = env_.ReadFile(absl::StrCat(folder.path(), "/", stored.file));
  if (!bytes.ok() || Sha256Hex(*bytes) != stored.sha256) {
    return Error(absl::StatusCode::kDataLoss, "REFERENCE_DAMAGED",
                 absl::StrFormat(
                     "%s, with which a new picture is to be compared, %s: nothing can "
                     "tell whether camera, object and lights are as they were. Resume "
                     "again to go on regardless; runs verify finds what else is "
                     "damaged",
                     stored.file,
                     bytes.ok() ? "is not what was stored"
                                : absl::StrCat("cannot be read (", MessageOf(bytes.status()), ")")),
                 {{"file", stored.file}});
  }
  ASSIGN_OR_RETURN(DecodedBasis then, DecodeBasisExr(*bytes, stored.file));
  if (!now.image.pixels.SameShape(then.image.pixels)) {
    return Error(absl::StatusCode::kFailedPrecondition, "REFERENCE_CHANGED",
                 absl::StrCat(stored.file, " has another size than the camera's pictures now"));
  }
  double difference = BlockDifference(now.image.pixels, then.image.pixels);
  spdlog::info("run: reference {} differs by {:.4f}", stored.file, difference);
  if (difference <= kReferenceTolerance) return absl::OkStatus();
  return Error(
      absl::StatusCode::kFailedPrecondition, "REFERENCE_CHANGED",
      absl::StrFormat("a new picture of %s differs from the stored one by %.1f %% (at most "
                      "%.1f %%): has the camera, the object or a light changed? Resume "
                      "again to go on regardless",
                      stored.file, 100 * difference, 100 * kReferenceTolerance),
      {{"file", stored.file}, {"difference", absl::StrCat(difference)}});
}

absl::Status RunManager::Cancel(const std::string& id) {
  if (auto active = ActiveRun(id);
      active && active->engine->progress().state != RunState::kInterrupted)
    return active->engine->Cancel();
  MutexLock launching(&launch_mutex_);
  {
    MutexLock lock(&mutex_);
    ForgetLocked(id);
  }
  ASSIGN_OR_RETURN(RunView run, Get(id));
  if (!NextState(run.state, RunEvent::kCancel).ok()) return NotActive(id, run.state, "cancel");
  ASSIGN_OR_RETURN(std::unique_ptr<RunFolder> folder, data_.OpenRun(id));
  RETURN_IF_ERROR(folder->PrepareToAppend());
  RETURN_IF_ERROR(folder->AppendState(RunState::kCancelled, absl::OkStatus(), rig_.WallNow()));
  MutexLock lock(&mutex_);
  ForgetLocked(id);
  return absl::OkStatus();
}

void RunManager::ForgetLocked(const std::string& id) {
  past_.erase(id);
  if (last_opened_ && last_opened_->header().id == id) last_opened_.reset();
  ++forgotten_;
}

std::string RunManager::active() const {
  std::shared_ptr<Active> active = CurrentRun();
  if (!active) return "";
  RunState state = active->engine->progress().state;
  return IsTerminal(state) || state == RunState::kInterrupted ? "" : active->id;
}

void RunManager::HoldActive(const absl::Status& reason) {
  if (auto active = CurrentRun()) active->engine->Hold(reason);
}

bool RunManager::at_rest() const {
  if (rig_.use() != RigUse::kRun) return true;
  auto active = CurrentRun();
  return active && active->engine->progress().state == RunState::kPaused;
}

void RunManager::Shutdown() {
  {
    MutexLock launching(&launch_mutex_);
    closing_ = true;
  }
  std::shared_ptr<Active> active = CurrentRun();
  if (!active) return;
  active->engine->Interrupt();
  if (active->thread.joinable()) active->thread.join();
}

// ---- Looking

RunView RunManager::ViewOf(const RunFolder& folder) const {
  const RunHeader& header = folder.header();
  RunTotals totals = folder.totals();
  StoredState stored = folder.state();
  RunView view{.id = header.id,
               .name = header.name,
               .directory = folder.path(),
               .created_at = header.created_at,
               .plan_json = header.plan_json,
               .state = stored.state,
               .reason = stored.reason,
               .total_shots = header.expected_shots,
               .done_shots = totals.records,
               .retakes = totals.retakes,
               .nothing_seen = totals.nothing_seen,
               .stored_bytes = totals.bytes};
  if (IsTerminal(view.state)) view.ended_at = stored.at;
  if (absl::Status damage = folder.damage(); !damage.ok()) {
    view.state = RunState::kFailed;
    view.reason = damage;
  }
  return view;
}

absl::StatusOr<RunView> RunManager::Get(const std::string& id) {
  if (auto active = ActiveRun(id)) {
    RunView view = ViewOf(*active->folder);
    RunProgress progress = active->engine->progress();
    view.state = progress.state;
    view.reason = progress.reason;
    view.pose = progress.pose;
    view.retakes = std::max<uint64_t>(view.retakes, progress.retakes);
    if (!IsTerminal(view.state)) view.ended_at.clear();
    if (view.state == RunState::kRunning) {
      MutexLock lock(&mutex_);
      double seconds = absl::ToDoubleSeconds(absl::Now() - active->running_since);
      double taken = static_cast<double>(view.done_shots) - static_cast<double>(active->done_then);
      if (seconds > 0 && taken > 0) {
        view.shots_per_second = taken / seconds;
        view.remaining_seconds =
            static_cast<double>(view.total_shots - view.done_shots) / view.shots_per_second;
      }
    }
    return view;
  }
  uint64_t forgotten;
  {
    MutexLock lock(&mutex_);
    auto it = past_.find(id);
    if (it != past_.end()) return it->second;
    forgotten = forgotten_;
  }
  ASSIGN_OR_RETURN(std::shared_ptr<RunFolder> folder, OpenFolder(id));
  RunView view = ViewOf(*folder);
  MutexLock lock(&mutex_);
  // Unless it has been changed, or begun again, meanwhile.
  if (forgotten == forgotten_) past_.emplace(id, view);
  return view;
}

absl::StatusOr<std::vector<RunView>> RunManager::List() {
  ASSIGN_OR_RETURN(std::vector<std::string> ids, data_.ListRuns());
  std::vector<RunView> runs;
  for (const std::string& id : ids) {
    auto run = Get(id);
    if (!run.ok()) {
      // A run that cannot be read is shown, not hidden.
      run = RunView{.id = id,
                    .name = id,
                    .directory = absl::StrCat(data_.path(), "/", kRunsFolder, "/", id),
                    .state = RunState::kFailed,
                    .reason = run.status()};
    }
    runs.push_back(*std::move(run));
  }
  return runs;
}

absl::StatusOr<std::shared_ptr<RunFolder>> RunManager::OpenFolder(const std::string& id) {
  uint64_t forgotten;
  {
    MutexLock lock(&mutex_);
    if (last_opened_ && last_opened_->header().id == id) return last_opened_;
    forgotten = forgotten_;
  }
  ASSIGN_OR_RETURN(std::shared_ptr<RunFolder> folder, data_.OpenRun(id));
  MutexLock lock(&mutex_);
  if (forgotten == forgotten_) last_opened_ = folder;
  return folder;
}

absl::StatusOr<std::shared_ptr<const RunFolder>> RunManager::Reread(const std::string& id) {
  if (auto active = ActiveRun(id); active && this->active() == id) return active->folder;
  ASSIGN_OR_RETURN(std::shared_ptr<const RunFolder> folder, data_.OpenRun(id));
  return folder;
}

absl::StatusOr<std::shared_ptr<const RunFolder>> RunManager::Folder(const std::string& id) {
  if (auto active = ActiveRun(id)) return active->folder;
  return OpenFolder(id);
}

}  // namespace lightstage
