// What a simulated device has in progress.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "base/async.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "base/status.h"
#include "sim/rig/device_timers.h"

namespace lightstage::sim {

// The operations of one device whose time of completion is known when they start: one at a time, and what interrupts it (Stop,
// Dark, Black) from any thread. Thread-safe.
template <class T>
class DeviceOperations {
 public:
  explicit DeviceOperations(DeviceTimers& timers) : timers_(timers) {}

  // Calls `apply()` – StatusOr<TimePoint>: does it to the world and says when it will be confirmed; kNever: it will not be – and
  // completes `done` with `outcome()` at that time: inside this call if that is now, with DEADLINE_EXCEEDED at `deadline` if that
  // comes first. FAILED_PRECONDITION / `busy_reason` while another operation or an interruption is in progress.
  template <class Apply, class Outcome>
  void Start(std::string_view busy_reason, const std::string& what, TimePoint deadline,
             Completion<T> done, Apply apply, Outcome outcome) {
    absl::StatusOr<TimePoint> at = TimePoint();
    {
      MutexLock lock(&mutex_);
      if (!operations_.empty() || !interruptions_.empty() || interrupting_ > 0) {
        at = Error(absl::StatusCode::kFailedPrecondition, busy_reason,
                   what + ": the device is still busy with what it was told before",
                   {{"operation", what}});
      } else {
        at = apply();
        // In one breath with apply(): whoever interrupts finds both or neither.
        if (at.ok() && *at > Now())
          return Schedule(operations_, *at, deadline, what, std::move(done), outcome);
      }
    }
    std::move(done)(at.ok() ? outcome() : absl::StatusOr<T>(at.status()));
  }

  // Calls `apply()` – TimePoint: when the device will be as told –, completes what is in progress with `why`, then `done` as
  // above.
  template <class Apply, class Outcome>
  void Interrupt(const absl::Status& why, const std::string& what, TimePoint deadline,
                 Completion<T> done, Apply apply, Outcome outcome) {
    std::map<uint64_t, Entry> interrupted;
    TimePoint at;
    {
      MutexLock lock(&mutex_);
      ++interrupting_;
      at = apply();
      interrupted.swap(operations_);
    }
    Complete(interrupted, why);
    {
      MutexLock lock(&mutex_);
      --interrupting_;
      if (at > Now()) return Schedule(interruptions_, at, deadline, what, std::move(done), outcome);
    }
    std::move(done)(outcome());
  }

  // Completes everything with CANCELLED. After timers.Close().
  void Close(const std::string& device) {
    std::map<uint64_t, Entry> left;
    {
      MutexLock lock(&mutex_);
      left.swap(operations_);
      left.merge(interruptions_);
    }
    Complete(left, Error(absl::StatusCode::kCancelled, "DEVICE_CLOSED", device + " was closed",
                         {{"device", device}}));
  }

 private:
  struct Entry {
    Completion<T> done;
    uint64_t timer = 0;
  };

  TimePoint Now() const { return timers_.clock().Now(); }

  template <class Outcome>
  void Schedule(std::map<uint64_t, Entry>& entries, TimePoint at, TimePoint deadline,
                const std::string& what, Completion<T> done, Outcome outcome)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    const uint64_t key = next_key_++;
    const bool confirmed = at <= deadline;
    auto due = [this, key, confirmed, what, outcome]() mutable {
      Completion<T> completion = Take(key);
      if (!completion) return;
      if (confirmed) return std::move(completion)(outcome());
      std::move(completion)(Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                                  what + " was not confirmed in time", {{"operation", what}}));
    };
    entries[key] = {std::move(done), timers_.At(confirmed ? at : deadline, std::move(due))};
  }

  Completion<T> Take(uint64_t key) {
    MutexLock lock(&mutex_);
    auto node = operations_.extract(key);
    if (node.empty()) node = interruptions_.extract(key);
    return node.empty() ? Completion<T>() : std::move(node.mapped().done);
  }

  void Complete(std::map<uint64_t, Entry>& entries, const absl::Status& status) {
    for (auto& [key, entry] : entries) {
      timers_.Cancel(entry.timer);
      std::move(entry.done)(status);
    }
  }

  DeviceTimers& timers_;
  Mutex mutex_;
  uint64_t next_key_ ABSL_GUARDED_BY(mutex_) = 0;
  int interrupting_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<uint64_t, Entry> operations_ ABSL_GUARDED_BY(mutex_);
  std::map<uint64_t, Entry> interruptions_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage::sim
