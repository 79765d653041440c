// The opened devices of one rig, behind one gate: after Stop() nothing moves or lights until Reset().
#pragma once

#include <initializer_list>
#include <memory>
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
  Pattern pattern;           // black if there is no projector
  absl::Status stop_reason;  // not OK while latched
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

  absl::Status Dark();  // and waits for it; any thread
  absl::Status HomeAll();
  absl::StatusOr<AxisState> MoveAxis(AxisId id, Angle target, double velocity_dps,
                                     absl::FunctionRef<bool()> cancelled);
  // The pose the axes report. Axes that do not exist are at 0.
  absl::StatusOr<Pose> ReadPose();
  absl::Status ArmCamera();
  absl::Status DisarmCamera();

  // ---- Any thread.

  // Stops motion and light now and latches. Returns when everything has confirmed; the error names what did not.
  absl::Status Stop(const absl::Status& reason);
  // Ends manual motion and light without latching (lost control).
  absl::Status Halt();
  absl::Status Reset();
  // OK, or FAILED_PRECONDITION / RIG_STOPPED with the reason of the stop.
  absl::Status CheckRunning() const;
  // Asks the axes, if `live`, else what they last reported.
  RigSnapshot Snapshot(bool live);
  Duration device_timeout() const { return file_.engine.device_timeout; }

 private:
  Rig(const RigFile& file, Clock& clock);
  absl::Status OpenDevices();
  absl::Status CheckRunningLocked() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(gate_);
  Axis* mutable_axis(AxisId id) {
    return id == AxisId::kTurntable ? turntable_.get() : tilt_.get();
  }
  absl::Status HomeAxis(AxisId id);
  absl::Status StopAxes(std::initializer_list<AxisId> ids);
  absl::Status StopDevices();
  void StoreAxis(AxisId id, const AxisState& state);
  void KeepLit();  // refreshes the lamps' time-to-dark as long as one is on
  absl::Status WaitAxis(AxisId id, Pending<AxisState>& pending, TimePoint deadline,
                        std::string_view what);

  const RigFile& file_;
  Clock& clock_;
  // Starting an operation and latching exclude each other: what was started before Stop() gets stopped, what comes after is
  // refused. It also makes calls into one device come from one thread at a time.
  mutable Mutex gate_;
  RigUse use_ ABSL_GUARDED_BY(gate_) = RigUse::kNone;
  absl::Status stop_reason_ ABSL_GUARDED_BY(gate_);

  mutable Mutex state_mutex_;  // after gate_; leaf
  AxisState axis_state_[2] ABSL_GUARDED_BY(state_mutex_);
  std::vector<float> lamp_levels_ ABSL_GUARDED_BY(state_mutex_);
  Pattern pattern_ ABSL_GUARDED_BY(state_mutex_);
  bool refreshing_ ABSL_GUARDED_BY(state_mutex_) = false;
  Clock::TimerId refresh_timer_ ABSL_GUARDED_BY(state_mutex_){};
  bool camera_armed_ = false;

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
  absl::Status Wait();

 private:
  friend class Rig;
  Rig* rig_ = nullptr;
  absl::Status refused_;
  TimePoint deadline_{};
  std::optional<Pending<LampsState>> lamps_;
  std::optional<Pending<ProjectorState>> projector_;
  std::vector<float> levels_;
  Pattern pattern_;
};

}  // namespace lightstage
