// The opened devices of one rig, behind one gate: after Stop() nothing moves or lights until Reset().
//
// Whoever exposes under a light or at a pose must know that nobody took it away meanwhile: what does so (Stop, Halt, lamps that went
// dark by themselves) counts as a disturbance, see CheckUndisturbed().
#pragma once

#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "daemon/config/rig_file.h"
#include "dataset/shot.h"

namespace lightstage {

enum class AxisId { kTurntable, kTilt };
const char* AxisName(AxisId id);  // "turntable", "tilt"

// What the rig was last seen doing. Lamps and pattern are as confirmed.
struct RigSnapshot {
  struct AxisReport {
    AxisId id;
    AxisState state;
  };
  std::vector<AxisReport> axes;
  std::vector<float> lamp_levels;
  std::optional<Pattern> pattern;  // nothing: not confirmed; black if there is no projector
  absl::Status stop_reason;        // not OK while latched
};

// Who is using the rig. One user at a time; stop and dark are for everyone.
enum class RigUse { kNone, kManual, kRun };

class Rig {
 public:
  // Opens every device of `file`, checks them against it (camera configuration, number of lamps, axis limits), and leaves the rig
  // dark and at rest. `file` and `clock` outlive the rig.
  static absl::StatusOr<std::unique_ptr<Rig>> Open(const RigFile& file, Clock& clock);
  ~Rig();

  const RigFile& file() const { return file_; }
  Clock& clock() { return clock_; }
  // For records that people read: real time, also where the rig's own is virtual.
  WallTime WallNow() const;
  Camera& camera() { return *camera_; }
  const Axis* axis(AxisId id) const {
    return id == AxisId::kTurntable ? turntable_.get() : tilt_.get();
  }
  const Lamps* lamps() const { return lamps_.get(); }
  const Projector* projector() const { return projector_.get(); }

  // ---- Use. FAILED_PRECONDITION: RIG_STOPPED while latched, RUN_ACTIVE or RIG_BUSY while somebody else uses it.
  absl::Status Acquire(RigUse use);
  void Release();
  RigUse use() const;

  // ---- For the one who uses it: operations start at once and are awaited later, so that they overlap.

  // Goes to a pose; axes already there are not moved. Axes that lost their position are homed first.
  class Posing;
  std::unique_ptr<Posing> StartPose(const Pose& pose);
  // Commands a condition; devices already showing it are left alone.
  class Lighting;
  std::unique_ptr<Lighting> StartCondition(const Condition& condition);

  // Asks the lights whether they have all the time been what the last condition confirmed. If not, the next one commands them anew.
  absl::Status CheckLight();

  absl::Status Dark();  // and waits for it; any thread
  absl::Status HomeAll();
  // Moves one axis by hand. Ends early, with everything at rest and dark, once `cancelled` says so.
  absl::StatusOr<AxisState> MoveAxis(AxisId id, Angle target, double velocity_dps,
                                     absl::FunctionRef<bool()> cancelled);
  // Turns one axis by hand at `velocity_dps` (signed), a limited one to its limit, for so long or until `cancelled` says so; returns its
  // state at rest. Light stays as it is.
  absl::StatusOr<AxisState> JogAxis(AxisId id, double velocity_dps, Duration time,
                                    absl::FunctionRef<bool()> cancelled);
  // The pose the axes report. Axes that do not exist are at 0.
  absl::StatusOr<Pose> ReadPose();
  // A camera that failed is disarmed and configured first, which reconnects one that was lost.
  absl::Status ArmCamera();
  absl::Status DisarmCamera();
  // An exposure or frame failed: what else may come of it is not to be taken for the next one's.
  void SuspectCamera() { camera_suspect_ = true; }

  // ---- Any thread.

  // Stops motion and light now and latches. Returns when everything has confirmed; the error names what did not.
  absl::Status Stop(const absl::Status& reason);
  // Ends motion and light without latching.
  absl::Status Halt();
  // The same, unless a run uses the rig (lost control). Nobody else gets the rig meanwhile.
  absl::Status HaltManual();
  // Makes the rig dark and still, homes its axes and clears the latch, which is set until then. A stop or halt meanwhile, or a
  // device that fails, leaves it set. FAILED_PRECONDITION / RIG_BUSY if another reset is in progress.
  absl::Status Reset();
  // OK, or FAILED_PRECONDITION / RIG_STOPPED with the reason of the stop.
  absl::Status CheckRunning() const;
  // Why it is latched; OK if it is not.
  absl::Status stop_reason() const;
  // Counts whatever took light or motion away from the rig's user.
  uint64_t disturbances() const;
  // OK, RIG_STOPPED, or ABORTED / RIG_DISTURBED if disturbances() has changed.
  absl::Status CheckUndisturbed(uint64_t since);
  // Asks the axes, if `live`, else what they last reported.
  RigSnapshot Snapshot(bool live);
  Duration device_timeout() const { return file_.engine.device_timeout; }

 private:
  Rig(const RigFile& file, Clock& clock);
  absl::Status OpenDevices();
  absl::Status OpenLamps();
  absl::Status ConfigureCamera();
  absl::Status CheckRunningLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(gate_);
  absl::Status CheckUndisturbedLocked(uint64_t since) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(gate_);
  Axis* mutable_axis(AxisId id) {
    return id == AxisId::kTurntable ? turntable_.get() : tilt_.get();
  }
  // What is allowed to go on while the rig is latched.
  enum class Latch { kRespect, kResetting };
  // At rest if it fails or `cancelled` says that it is not wanted any more: CANCELLED / STOPPED.
  absl::Status HomeAxis(
      AxisId id, uint64_t since, Latch latch,
      absl::FunctionRef<bool()> cancelled = [] { return false; });
  absl::Status HomeAll(uint64_t since, Latch latch);
  absl::StatusOr<AxisState> ReadAxis(AxisId id);
  // Homes it first if it does not know its position.
  absl::StatusOr<AxisState> ReferencedAxis(AxisId id, uint64_t since,
                                           absl::FunctionRef<bool()> cancelled);
  // What a motion by hand ended with, at rest if it failed.
  absl::StatusOr<AxisState> EndByHand(AxisId id, Pending<AxisState>& motion, TimePoint deadline,
                                      std::string_view what);
  // Commands first, waits later: a device that does not answer delays no other.
  struct Darkening {
    uint64_t lighting = 0;  // the last condition before it
    std::optional<Pending<LampsState>> lamps;
    std::optional<Pending<ProjectorState>> projector;
    TimePoint lamps_deadline{}, projector_deadline{};
  };
  struct Standstill {
    std::vector<std::pair<AxisId, Pending<AxisState>>> axes;
    TimePoint deadline{};
  };
  struct Stopping {
    Darkening darkening;
    Standstill standstill;
  };
  Darkening StartDarkLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(gate_);
  absl::Status FinishDark(Darkening& darkening);
  Standstill StartStopLocked(std::initializer_list<AxisId> ids)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(gate_);
  absl::Status FinishStop(Standstill& standstill);
  absl::Status StopAxis(AxisId id);
  // Everything at once, counted as a disturbance.
  Stopping StopDevicesLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(gate_);
  absl::Status Finish(Stopping& stopping);
  void StoreAxis(AxisId id, const AxisState& state);
  void MarkMoving(AxisId id);
  // Refreshes the lamps' time-to-dark from now on, as long as one is to be lit.
  void KeepLitLocked(const std::vector<float>& levels) ABSL_EXCLUSIVE_LOCKS_REQUIRED(state_mutex_);
  // Notices that they have gone dark by themselves.
  void CheckStillLitLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(gate_, state_mutex_);
  void ScheduleRefreshLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(state_mutex_);
  void RefreshLamps();
  absl::Status WaitAxis(AxisId id, Pending<AxisState>& pending, TimePoint deadline,
                        std::string_view what);

  const RigFile& file_;
  Clock& clock_;
  // Starting an operation and latching exclude each other: what was started before Stop() gets stopped, what comes after is
  // refused. It also makes calls into one device come from one thread at a time.
  mutable Mutex gate_;
  RigUse use_ ABSL_GUARDED_BY(gate_) = RigUse::kNone;
  absl::Status stop_reason_ ABSL_GUARDED_BY(gate_);
  bool resetting_ ABSL_GUARDED_BY(gate_) = false;
  uint64_t disturbances_ ABSL_GUARDED_BY(gate_) = 0;
  uint64_t light_commands_ ABSL_GUARDED_BY(gate_) =
      0;  // conditions; an answer to an older one does not count

  mutable Mutex state_mutex_;  // after gate_; leaf
  AxisState axis_state_[2] ABSL_GUARDED_BY(state_mutex_);
  // As confirmed, and the command that they answer to; NaN where nothing was confirmed.
  std::vector<float> lamp_levels_ ABSL_GUARDED_BY(state_mutex_);
  std::vector<float> lamps_asked_ ABSL_GUARDED_BY(state_mutex_);
  TimePoint lit_at_ ABSL_GUARDED_BY(state_mutex_){};  // when the light of now was confirmed
  std::optional<Pattern> pattern_ ABSL_GUARDED_BY(state_mutex_) = Pattern{};
  bool keep_lit_ ABSL_GUARDED_BY(state_mutex_) = false;     // a lamp was told to be on
  bool refreshing_ ABSL_GUARDED_BY(state_mutex_) = false;   // a timer is set
  TimePoint refreshed_at_ ABSL_GUARDED_BY(state_mutex_){};  // last sign of life: when it was sent
  Duration time_to_dark_{};  // 0: the lamps have none, or it is switched off
  // Held during a refresh, which a timer starts; empty once the rig closes. shared: the timer may outlive the rig.
  struct RefreshGuard {
    Mutex mutex;  // before gate_
    Rig* rig ABSL_GUARDED_BY(mutex);
  };
  std::shared_ptr<RefreshGuard> refresh_guard_;
  bool camera_armed_ = false, camera_suspect_ = false;

  // Last, so that devices go first: their destructors may still call back.
  std::unique_ptr<Lamps> lamps_;
  std::unique_ptr<Projector> projector_;
  std::unique_ptr<Axis> turntable_, tilt_;
  std::unique_ptr<Camera> camera_;
};

// Motions on their way. Wait() once.
class Rig::Posing {
 public:
  absl::Status Wait();

 private:
  friend class Rig;
  struct Motion {
    AxisId axis;
    Pending<AxisState> pending;
    TimePoint deadline;
    Angle target;
  };
  Rig* rig_ = nullptr;
  absl::Status refused_;
  std::vector<Motion> motions_;
};

// Light on its way. Wait() once.
class Rig::Lighting {
 public:
  // LIGHT_NOT_CONFIRMED if a device confirmed another light than it was told to make.
  absl::Status Wait();
  // After Wait(): every lamp's level as confirmed, as fine as the lamps can do it.
  const std::vector<float>& lamp_levels() const { return confirmed_; }
  // After Wait(): when the last of the lights had confirmed that it is as it is, rig clock.
  TimePoint lit_at() const { return lit_at_; }

 private:
  friend class Rig;
  Rig* rig_ = nullptr;
  absl::Status refused_;
  uint64_t since_ = 0, command_ = 0;
  TimePoint deadline_{};
  std::optional<Pending<LampsState>> lamps_;
  std::optional<Pending<ProjectorState>> projector_;
  std::vector<float> levels_, confirmed_;
  Pattern pattern_;
  TimePoint lit_at_{};
};

}  // namespace lightstage
