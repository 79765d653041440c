// The sequencer: takes a program's shots one after another on one rig and hands the raw frames on.
//
// Overlap: from the end of a shot's last exposure on, its readout, the next move, the next light change and the developing and
// storing of earlier shots go on together. The next exposure starts when move, light and readout have all been confirmed.
//
// Threads: Run() blocks its caller for the whole run; everything else is for any thread.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "base/mutex.h"
#include "daemon/capture/program.h"
#include "daemon/capture/rig_facts.h"
#include "daemon/engine/run_state.h"
#include "daemon/engine/shot_sink.h"
#include "daemon/rig/bracket.h"
#include "daemon/rig/rig.h"

namespace lightstage {

// What watchers see.
struct RunProgress {
  RunState state = RunState::kRunning;
  absl::Status reason;   // why it is paused, failed or interrupted
  Pose pose;             // last commanded
  uint64_t retakes = 0;  // attempts beyond the first, over all shots
  uint64_t stored = 0;   // shots stored since Run() began
};

class Engine {
 public:
  struct Hooks {
    // The state or its reason changes; progress() tells it afterwards, when it is kept. Called in order, from any thread; must not
    // call back into the engine.
    std::function<void(RunState, const absl::Status& reason)> state_changed;
    // Everything is stored: completes the dataset. Its error holds the run, and resuming tries again.
    std::function<absl::Status()> finish;
  };
  // How a run goes on that an earlier process began.
  struct Resumption {
    // A stored shot to take again first; none if there is nothing to compare with.
    std::optional<Shot> reference;
    // Compares it with what is stored. Its error holds the run once; resuming after that goes on regardless.
    std::function<absl::Status(const RawShot&)> compare;
  };

  // All references outlive the engine. `done(id)`: the shot has a record already.
  Engine(Rig& rig, const RigFacts& facts, Program& program, const Results& results,
         std::function<bool(uint64_t)> done, std::optional<Resumption> resumption, Hooks hooks);

  // What stands behind the sink reports here; any thread.
  void OnOutcome(uint64_t shot_id, const absl::Status& stored);

  // Takes all shots; returns in a terminal state, or INTERRUPTED after Interrupt(), with the rig dark. The caller has acquired the rig.
  RunState Run(ShotSink& sink);

  absl::Status Pause();
  absl::Status Resume();
  absl::Status Cancel();
  // Pauses at once because of `reason`; no effect on a run that is paused or ending.
  void Hold(const absl::Status& reason);
  // The daemon is going down: ends Run() as soon as the devices let it.
  void Interrupt();

  RunProgress progress() const;

 private:
  struct Attempt {
    Shot shot;
    int number = 1;
    int last = 1;               // with this one the engine gives up
    std::string first_failure;  // often the cause of those that follow; empty before
  };
  // A shot whose last exposure has ended and whose last frame may still be on its way.
  struct InFlight {
    Attempt attempt;
    Pose reported_pose;
    TimePoint lit_at;
    WallTime captured_at;
    Bracket bracket;
  };

  absl::Status Prepare();
  absl::Status CompareReference();
  // The next shot to take; nothing if the program is done or the run is to be held.
  absl::StatusOr<std::optional<Attempt>> Next(ShotSink& sink);
  // Poses, lights and exposes; the shot before is collected meanwhile. Leaves the shot in flight.
  absl::Status Take(const Attempt& attempt, ShotSink& sink);
  // Under the light as confirmed; `since`: Bracket's.
  absl::Status Expose(const Attempt& attempt, const Rig::Lighting& lighting, uint64_t since);
  // The pose the axes report; ABORTED / POSE_NOT_HELD if it is not the shot's.
  absl::StatusOr<Pose> ReadHeldPose(const Shot& shot);
  // Puts the shot in flight, if there is one, into the sink; `stalled` is called if that takes long.
  void Collect(ShotSink& sink, absl::FunctionRef<void()> stalled);
  // Collects, goes dark, and waits until everything captured so far is stored or to be taken again.
  void Settle(ShotSink& sink);
  static RawShot Raw(InFlight taken, std::vector<Frame> frames);
  // Queues the shot again, or holds the run if it has had all its attempts.
  void Failed(const Attempt& attempt, const absl::Status& status);
  void TakeOutcomes();
  // Winds up to the shot boundary, goes dark, waits.
  void PauseHere(ShotSink& sink);
  // Latches the rig if that is not confirmed.
  void Darken();
  // Also disarms the camera.
  void GoDark();
  absl::Status Apply(RunEvent event, const absl::Status& reason);
  RunState state() const;

  Rig& rig_;
  const RigFacts& facts_;
  Program& program_;
  const Results& results_;
  const std::function<bool(uint64_t)> done_before_;
  const std::optional<Resumption> resumption_;
  const Hooks hooks_;

  // Run()'s thread only.
  std::deque<Attempt> again_;  // to be taken before the program is asked for more
  std::map<uint64_t, Attempt>
      unstored_;  // handed to the sink, no outcome yet; bounded by the sink's queue
  std::optional<InFlight> in_flight_;
  std::optional<OperatorRequest>
      request_;  // yielded, and due before the next shot that has no record
  std::optional<Attempt> after_request_;  // that shot
  bool resumption_done_ = false;

  Mutex apply_mutex_;  // before mutex_: keeps state changes and their reports in one order
  mutable Mutex mutex_;
  CondVar changed_;
  RunProgress progress_ ABSL_GUARDED_BY(mutex_);
  std::deque<std::pair<uint64_t, absl::Status>> outcomes_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage
