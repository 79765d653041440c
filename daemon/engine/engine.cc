#include "daemon/engine/engine.h"

#include <cmath>

#include "absl/strings/str_format.h"
#include "daemon/capture/limits.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

// How long the light of the next shot may be on while the store has no room for the last one.
constexpr std::chrono::seconds kPatience(5);

// How far a reported position may be from the commanded one when the exposure begins and ends. A move confirms within the axis' tolerance; an
// axis that has since been pushed has not.
absl::Status CheckHeld(const Axis* axis, AxisId id, Angle commanded, Angle reported) {
  if (!axis) return absl::OkStatus();
  double off = std::abs(MoveDistance(axis->info(), commanded, reported).degrees());
  if (off <= axis->info().tolerance.degrees()) return absl::OkStatus();
  return Error(
      absl::StatusCode::kAborted, "POSE_NOT_HELD",
      absl::StrFormat("%s: reports %.4f deg, was sent to %.4f deg (tolerance %g deg)", AxisName(id),
                      reported.degrees(), commanded.degrees(), axis->info().tolerance.degrees()),
      {{"axis", AxisName(id)},
       {"reported_deg", absl::StrCat(reported.degrees())},
       {"commanded_deg", absl::StrCat(commanded.degrees())},
       {"tolerance_deg", absl::StrCat(axis->info().tolerance.degrees())}});
}

}  // namespace

Engine::Engine(Rig& rig, const RigFacts& facts, Program& program, const Results& results,
               std::function<bool(uint64_t)> done, std::optional<Resumption> resumption,
               Hooks hooks)
    : rig_(rig),
      facts_(facts),
      program_(program),
      results_(results),
      done_before_(std::move(done)),
      resumption_(std::move(resumption)),
      hooks_(std::move(hooks)) {}

// ---- State, any thread

RunState Engine::state() const {
  MutexLock lock(&mutex_);
  return progress_.state;
}

RunProgress Engine::progress() const {
  MutexLock lock(&mutex_);
  return progress_;
}

absl::Status Engine::Apply(RunEvent event, const absl::Status& reason) {
  MutexLock order(&apply_mutex_);
  ASSIGN_OR_RETURN(RunState next, NextState(state(), event));
  spdlog::info("run: {} ({}{}{})", RunStateName(next), RunEventName(event), reason.ok() ? "" : ": ",
               MessageOf(reason));
  hooks_.state_changed(next, reason);
  MutexLock lock(&mutex_);
  progress_.state = next;
  progress_.reason = reason;
  changed_.SignalAll();
  return absl::OkStatus();
}

void Engine::Hold(const absl::Status& reason) {
  RunProgress now = progress();
  if (now.state == RunState::kPausing && !now.reason.ok()) return;  // the first reason is the cause
  // Refused only when the run is ending anyway.
  (void)Apply(RunEvent::kHold, reason);
}

absl::Status Engine::Pause() { return Apply(RunEvent::kPause, absl::OkStatus()); }

absl::Status Engine::Resume() {
  RETURN_IF_ERROR(NextState(state(), RunEvent::kResume).status());
  RETURN_IF_ERROR(rig_.CheckRunning());
  return Apply(RunEvent::kResume, absl::OkStatus());
}

absl::Status Engine::Cancel() { return Apply(RunEvent::kCancel, absl::OkStatus()); }

void Engine::Interrupt() {
  (void)Apply(RunEvent::kInterrupt,
              Error(absl::StatusCode::kAborted, "DAEMON_ENDED", "the daemon was told to end"));
}

void Engine::OnOutcome(uint64_t shot_id, const absl::Status& stored) {
  MutexLock lock(&mutex_);
  outcomes_.emplace_back(shot_id, stored);
  if (stored.ok()) ++progress_.stored;
}

// ---- The run, Run()'s thread

RunState Engine::Run(ShotSink& sink) {
  bool prepared = false;
  while (true) {
    TakeOutcomes();
    RunState now = state();
    if (now == RunState::kPausing) {
      PauseHere(sink);
      prepared = false;
      continue;
    }
    if (now != RunState::kRunning) break;
    if (!prepared) {
      absl::Status ready = Prepare();
      prepared = ready.ok();
      if (!prepared) Hold(ready);
      continue;
    }
    auto next = Next(sink);
    if (!next.ok()) {
      (void)Apply(RunEvent::kFail, next.status());
      break;
    }
    if (next->has_value()) {
      absl::Status taken = Take(**next, sink);
      if (!taken.ok()) Failed(**next, taken);
      continue;
    }
    Settle(sink);
    if (!again_.empty() || state() != RunState::kRunning) continue;
    GoDark();
    absl::Status finished = hooks_.finish();
    if (!finished.ok()) {
      Hold(finished);
      continue;
    }
    // A pause that came in this very moment has nothing left to pause.
    if (Apply(RunEvent::kFinished, absl::OkStatus()).ok()) return RunState::kSucceeded;
  }
  // Cancelled, interrupted or failed: what was captured is stored all the same.
  Settle(sink);
  GoDark();
  if (state() == RunState::kCancelling) (void)Apply(RunEvent::kEnded, absl::OkStatus());
  return state();
}

absl::Status Engine::Prepare() {
  if (resumption_ && !resumption_done_) RETURN_IF_ERROR(rig_.HomeAll());
  RETURN_IF_ERROR(rig_.ArmCamera());
  if (resumption_ && !resumption_done_) {
    if (resumption_->reference) RETURN_IF_ERROR(CompareReference());
    resumption_done_ = true;
  }
  return absl::OkStatus();
}

absl::Status Engine::CompareReference() {
  Attempt attempt{.shot = *resumption_->reference};
  uint64_t since = rig_.disturbances();
  auto posing = rig_.StartPose(attempt.shot.pose);
  auto lighting = rig_.StartCondition(attempt.shot.condition);
  RETURN_IF_ERROR(posing->Wait());
  RETURN_IF_ERROR(lighting->Wait());
  RETURN_IF_ERROR(Expose(attempt, *lighting, since));
  InFlight taken = *std::exchange(in_flight_, std::nullopt);
  ASSIGN_OR_RETURN(std::vector<Frame> frames, taken.bracket.TakeFrames());
  resumption_done_ = true;  // whatever it says, it is said once
  return resumption_->compare(Raw(std::move(taken), std::move(frames)));
}

absl::StatusOr<std::optional<Engine::Attempt>> Engine::Next(ShotSink& sink) {
  while (true) {
    if (!again_.empty()) {
      Attempt attempt = std::move(again_.front());
      again_.pop_front();
      return attempt;
    }
    if (after_request_) {
      // What came before the request is taken, retakes and all, before the operator changes the scene.
      Settle(sink);
      if (state() != RunState::kRunning) return std::nullopt;
      if (!again_.empty()) continue;
      again_.push_back(*std::exchange(after_request_, std::nullopt));
      Hold(Error(absl::StatusCode::kUnavailable, "OPERATOR_REQUEST", request_->message,
                 {{"request", request_->message}}));
      request_.reset();
      return std::nullopt;
    }
    ASSIGN_OR_RETURN(Step step, program_.Next(results_));
    if (auto* shot = std::get_if<Shot>(&step)) {
      if (done_before_(shot->id)) {
        request_.reset();  // it was met before this shot was taken
        continue;
      }
      RETURN_IF_ERROR(CheckShot(*shot, facts_));
      Attempt attempt{std::move(*shot), 1, rig_.file().engine.max_attempts};
      if (request_) {
        after_request_ = std::move(attempt);
      } else {
        again_.push_back(std::move(attempt));
      }
    } else if (auto* request = std::get_if<OperatorRequest>(&step)) {
      request_ = std::move(*request);
    } else if (std::holds_alternative<AwaitResults>(step)) {
      Settle(sink);
      if (state() != RunState::kRunning) return std::nullopt;
    } else {
      request_.reset();
      return std::nullopt;
    }
  }
}

absl::Status Engine::Take(const Attempt& attempt, ShotSink& sink) {
  {
    MutexLock lock(&mutex_);
    progress_.pose = attempt.shot.pose;
  }
  uint64_t since = rig_.disturbances();
  auto posing = rig_.StartPose(attempt.shot.pose);
  auto lighting = rig_.StartCondition(attempt.shot.condition);
  bool darkened = false;
  // This shot's light is on already, and nobody knows how long a disk takes to come back.
  Collect(sink, [&] {
    (void)lighting->Wait();
    Darken();
    darkened = true;
  });
  if (darkened) lighting = rig_.StartCondition(attempt.shot.condition);
  absl::Status posed = posing->Wait();
  absl::Status lit = lighting->Wait();
  RETURN_IF_ERROR(posed);
  RETURN_IF_ERROR(lit);
  RETURN_IF_ERROR(rig_.ArmCamera());
  return Expose(attempt, *lighting, since);
}

absl::Status Engine::Expose(const Attempt& attempt, const Rig::Lighting& lighting, uint64_t since) {
  const Shot& shot = attempt.shot;
  ASSIGN_OR_RETURN(const Pose reported, ReadHeldPose(shot));
  in_flight_.emplace(InFlight{attempt, reported, lighting.lit_at(), rig_.WallNow(),
                              Bracket(rig_, shot.exposures, since)});
  // The record says what the lamps really did.
  for (LampLevel& lamp : in_flight_->attempt.shot.condition.lamps)
    lamp.level = lighting.lamp_levels()[lamp.lamp];
  absl::Status exposed = in_flight_->bracket.Expose();
  if (exposed.ok()) exposed = ReadHeldPose(shot).status();
  if (!exposed.ok()) {
    rig_.SuspectCamera();  // its last frame may be still on its way
    in_flight_.reset();
  }
  return exposed;
}

absl::StatusOr<Pose> Engine::ReadHeldPose(const Shot& shot) {
  ASSIGN_OR_RETURN(const Pose reported, rig_.ReadPose());
  RETURN_IF_ERROR(CheckHeld(rig_.axis(AxisId::kTurntable), AxisId::kTurntable, shot.pose.azimuth,
                            reported.azimuth));
  RETURN_IF_ERROR(
      CheckHeld(rig_.axis(AxisId::kTilt), AxisId::kTilt, shot.pose.tilt, reported.tilt));
  return reported;
}

void Engine::Collect(ShotSink& sink, absl::FunctionRef<void()> stalled) {
  if (!in_flight_) return;
  InFlight taken = *std::exchange(in_flight_, std::nullopt);
  auto frames = taken.bracket.TakeFrames();
  if (!frames.ok()) {
    Failed(taken.attempt, frames.status());
    return;
  }
  unstored_[taken.attempt.shot.id] = taken.attempt;
  sink.Put(Raw(std::move(taken), *std::move(frames)), kPatience, [&] {
    spdlog::warn("run: the store has taken no shot for {} s: dark until it does",
                 Seconds(kPatience));
    stalled();
  });
}

void Engine::Settle(ShotSink& sink) {
  Collect(sink, [this] { Darken(); });
  Darken();
  sink.Drain();
  TakeOutcomes();
}

RawShot Engine::Raw(InFlight taken, std::vector<Frame> frames) {
  RawShot raw{.shot = std::move(taken.attempt.shot),
              .reported_pose = taken.reported_pose,
              .lit_at = taken.lit_at,
              .frames = std::move(frames),
              .attempt = taken.attempt.number,
              .captured_at = taken.captured_at};
  raw.exposures = ExposureRecords(raw.shot.exposures, raw.frames);
  return raw;
}

void Engine::Failed(const Attempt& attempt, const absl::Status& status) {
  again_.push_back(attempt);
  absl::Status stopped = rig_.stop_reason();
  if (!stopped.ok()) {
    Hold(stopped);  // not the shot's fault: it does not count
    return;
  }
  spdlog::warn("run: shot {}: attempt {} failed: {}", attempt.shot.id, attempt.number,
               MessageOf(status));
  bool disk_full = status.code() == absl::StatusCode::kResourceExhausted;
  if (attempt.number >= attempt.last || disk_full) {
    std::string where = absl::StrFormat("shot %d, attempt %d", attempt.shot.id, attempt.number);
    if (!attempt.first_failure.empty() && attempt.first_failure != status.message())
      absl::StrAppend(&where, " (the first failed with: ", attempt.first_failure, ")");
    Hold(Annotate(status, where));
  }
  ++again_.back().number;
  if (attempt.first_failure.empty()) again_.back().first_failure = std::string(status.message());
  MutexLock lock(&mutex_);
  ++progress_.retakes;
}

void Engine::TakeOutcomes() {
  std::deque<std::pair<uint64_t, absl::Status>> outcomes;
  {
    MutexLock lock(&mutex_);
    outcomes.swap(outcomes_);
  }
  for (auto& [id, stored] : outcomes) {
    auto it = unstored_.find(id);
    if (it == unstored_.end()) continue;
    Attempt attempt = std::move(it->second);
    unstored_.erase(it);
    if (!stored.ok()) Failed(attempt, stored);
  }
}

void Engine::Darken() {
  absl::Status dark = rig_.Dark();
  if (dark.ok()) return;
  // Light that may still be on is what the latch is for.
  absl::Status stopped = rig_.Stop(Annotate(dark, "not confirmed dark"));
  if (!stopped.ok()) spdlog::error("rig: {}", MessageOf(stopped));
}

void Engine::GoDark() {
  Darken();
  absl::Status disarmed = rig_.DisarmCamera();
  if (!disarmed.ok()) spdlog::warn("run: {}", MessageOf(disarmed));
}

void Engine::PauseHere(ShotSink& sink) {
  Settle(sink);
  GoDark();
  (void)Apply(RunEvent::kPausedNow, progress().reason);  // refused if cancelled meanwhile
  {
    MutexLock lock(&mutex_);
    while (progress_.state == RunState::kPaused) changed_.Wait(&mutex_);
  }
  for (Attempt& attempt : again_) {
    attempt.last = attempt.number + rig_.file().engine.max_attempts - 1;
    attempt.first_failure.clear();
  }
}

}  // namespace lightstage
