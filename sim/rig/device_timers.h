// Timers of one device, safe to destroy: nothing runs any more after Close().
#pragma once

#include <cstdint>
#include <map>
#include <memory>

#include "absl/base/thread_annotations.h"
#include "base/clock.h"
#include "base/mutex.h"

namespace lightstage::sim {

// Thread-safe. Callbacks run as the clock runs them, without a lock held.
class DeviceTimers {
 public:
  explicit DeviceTimers(Clock& clock);
  ~DeviceTimers() { Close(); }
  DeviceTimers(const DeviceTimers&) = delete;
  DeviceTimers& operator=(const DeviceTimers&) = delete;

  Clock& clock() const { return clock_; }
  // Does nothing, and returns 0, after Close().
  uint64_t At(TimePoint t, Clock::Callback fn);
  void Cancel(uint64_t id);
  // Cancels all and waits until no callback is running. Not from a callback.
  void Close();

 private:
  struct State {
    Mutex mutex;
    CondVar idle;
    bool closed ABSL_GUARDED_BY(mutex) = false;
    int running ABSL_GUARDED_BY(mutex) = 0;
    uint64_t next_id ABSL_GUARDED_BY(mutex) = 1;
    std::map<uint64_t, Clock::TimerId> pending ABSL_GUARDED_BY(mutex);
  };
  Clock& clock_;
  // shared: the clock may be about to call a timer that cannot be cancelled any more.
  const std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace lightstage::sim
