// Ends calls and waits from another thread: Ctrl-C, or a lease that was lost.
#pragma once

#include <atomic>
#include <set>

#include "absl/base/thread_annotations.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "grpcpp/client_context.h"

namespace lightstage::client {

// Thread-safe; not to be called from a signal handler (wait for the signal on a thread). Stays
// cancelled.
class Canceller {
 public:
  // `clock` must be on real time, as the network is, and outlive this object.
  explicit Canceller(Clock& clock) : clock_(clock) {}
  Canceller(const Canceller&) = delete;
  Canceller& operator=(const Canceller&) = delete;

  void Cancel();
  bool cancelled() const { return cancelled_.load(std::memory_order_acquire); }

  // Waits until then, or until Cancel(): true if cancelled.
  bool SleepUntil(TimePoint deadline);

  // While it lives, Cancel() ends the call of `context`, also one that has not begun yet.
  class CallScope {
   public:
    CallScope(Canceller& canceller, grpc::ClientContext& context);
    ~CallScope();
    CallScope(const CallScope&) = delete;
    CallScope& operator=(const CallScope&) = delete;

   private:
    Canceller& canceller_;
    grpc::ClientContext& context_;
  };

 private:
  Clock& clock_;
  std::atomic<bool> cancelled_{false};
  Mutex mutex_;
  std::set<grpc::ClientContext*> calls_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage::client
