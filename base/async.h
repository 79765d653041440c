// One asynchronous result. A device operation takes a Completion<T> and calls it exactly once, from any thread, possibly before
// the call that started it returns: then nobody waits and no thread is switched.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "absl/functional/any_invocable.h"
#include "absl/strings/str_cat.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "base/status.h"

namespace lightstage {

template <class T>
using Completion = absl::AnyInvocable<void(absl::StatusOr<T>) &&>;

// Where a Completion<T> lands. Start an operation with sink(), then Wait(). A result that comes after the waiter gave up is
// discarded safely.
template <class T>
class Pending {
 public:
  explicit Pending(Clock& clock) : clock_(&clock), state_(std::make_shared<State>()) {}

  // To be given to exactly one operation.
  Completion<T> sink() {
    return [state = state_, clock = clock_](absl::StatusOr<T> result) {
      state->result = std::move(result);
      state->at = clock->Now();
      state->done.store(true, std::memory_order_release);
      clock->Notify();
    };
  }

  bool done() const { return state_->done.load(std::memory_order_acquire); }
  // When the result came; only after it has.
  TimePoint done_at() const { return state_->at; }

  // The operation's result, or DEADLINE_EXCEEDED naming `what` if it has not come by `deadline`. Call once.
  absl::StatusOr<T> Wait(TimePoint deadline, std::string_view what) {
    if (!clock_->WaitUntil(deadline, [this] { return done(); })) {
      return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                   absl::StrCat(what, " did not answer in time"),
                   {{"operation", std::string(what)}});
    }
    return std::move(state_->result);
  }

 private:
  struct State {
    absl::StatusOr<T> result{absl::UnknownError("no result yet")};
    TimePoint at{};
    std::atomic<bool> done{false};
  };
  Clock* clock_;
  std::shared_ptr<State> state_;  // shared: the result may come after the waiter is gone
};

}  // namespace lightstage
