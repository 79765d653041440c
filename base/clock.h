// The one monotonic clock that every wait, deadline and device event of a rig is on.
//
// Two implementations: RealClock follows the machine's steady clock; VirtualClock is a discrete-event clock on which a night's
// capture takes as long as its computations do. Code that waits must not know which one it has.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/functional/any_invocable.h"
#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"

namespace lightstage {

using Duration = std::chrono::nanoseconds;

// Tag of the rig's monotonic clock: a TimePoint can not be mixed with wall-clock or device time.
struct RigClock {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<RigClock>;
  static constexpr bool is_steady = true;
};
using TimePoint = RigClock::time_point;
using WallTime = std::chrono::time_point<std::chrono::system_clock, std::chrono::microseconds>;

constexpr TimePoint kNever = TimePoint::max();

inline double Seconds(Duration d) { return std::chrono::duration<double>(d).count(); }
inline Duration FromSeconds(double s) {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(s));
}

class Clock {
 public:
  using Callback = absl::AnyInvocable<void() &&>;
  using TimerId = std::pair<TimePoint, uint64_t>;

  virtual ~Clock() = default;

  virtual TimePoint Now() const = 0;
  // UTC, for records that people read. Never used to wait.
  virtual WallTime WallNow() const = 0;

  // Calls `fn` once, at `t` or soon after, in order of time, then of registration. It runs without any lock held: on the
  // clock's own thread (RealClock) or on the thread that is waiting (VirtualClock). It must be short and must not wait.
  virtual TimerId At(TimePoint t, Callback fn) = 0;
  // True if the timer will not run any more; false if it has run or is running.
  virtual bool Cancel(TimerId id) = 0;

  // Blocks until `ready()` (called without a lock, on this thread) or until `deadline`; true if ready. Returns at once, without a
  // context switch, if `ready()` already holds. Whoever makes `ready()` true calls Notify() afterwards.
  // On a VirtualClock, waiting is what moves time: wait here only for what happens on this clock, and for the work of other
  // threads (develop, store, clients) with kNever or elsewhere.
  virtual bool WaitUntil(TimePoint deadline, absl::FunctionRef<bool()> ready) = 0;
  virtual void Notify() = 0;

  // True if time is virtual: real hardware can not be driven by it.
  virtual bool is_virtual() const = 0;
};

class RealClock final : public Clock {
 public:
  RealClock();
  ~RealClock() override;
  TimePoint Now() const override;
  WallTime WallNow() const override;
  TimerId At(TimePoint t, Callback fn) override;
  bool Cancel(TimerId id) override;
  bool WaitUntil(TimePoint deadline, absl::FunctionRef<bool()> ready) override;
  void Notify() override;
  bool is_virtual() const override { return false; }

 private:
  void RunTimers();

  Mutex mutex_;
  CondVar changed_;  // for waiters
  CondVar timers_changed_;
  uint64_t generation_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t next_id_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<TimerId, Callback> timers_ ABSL_GUARDED_BY(mutex_);
  bool quit_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

class VirtualClock final : public Clock {
 public:
  // Wall time starts at `wall_epoch`, so that records of a simulated run can be reproduced.
  explicit VirtualClock(WallTime wall_epoch = WallTime{});
  TimePoint Now() const override;
  WallTime WallNow() const override;
  TimerId At(TimePoint t, Callback fn) override;
  bool Cancel(TimerId id) override;
  bool WaitUntil(TimePoint deadline, absl::FunctionRef<bool()> ready) override;
  void Notify() override;
  bool is_virtual() const override { return true; }

 private:
  const WallTime wall_epoch_;
  mutable Mutex mutex_;
  CondVar changed_;
  TimePoint now_ ABSL_GUARDED_BY(mutex_){};
  uint64_t generation_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t next_id_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<TimerId, Callback> timers_ ABSL_GUARDED_BY(mutex_);
  bool driving_ ABSL_GUARDED_BY(mutex_) = false;  // one waiter at a time runs timers
};

// RFC 3339 with microseconds, e.g. "2004-05-06T07:08:09.123456Z"; and back (INVALID_ARGUMENT / TIME_INVALID).
std::string FormatUtc(WallTime t);
absl::StatusOr<WallTime> ParseUtc(std::string_view text);

// Sleeps on `clock`.
void SleepFor(Clock& clock, Duration d);

}  // namespace lightstage
