// Makes a call again after its connection broke.
#pragma once

#include "absl/functional/any_invocable.h"
#include "absl/status/status.h"
#include "base/clock.h"
#include "client/cpp/canceller.h"
#include "client/cpp/connection.h"

namespace lightstage::client {

// How long a helper tries to reach a daemon that is gone, by default: time enough for a restart.
constexpr Duration kPatience = std::chrono::minutes(2);

// Called when a connection broke and is tried again: with the error, on the caller's thread.
using BreakCallback = absl::AnyInvocable<void(const absl::Status&)>;

class Retry {
 public:
  Retry(Connection& connection, Canceller& canceller, Duration patience, BreakCallback& on_break);

  // An answer came: what was waited before counts no more.
  void Progressed();

  // After a call ended with the error `broken`: waits and reconnects. OK means call again; an error
  // means give up, for `broken` is of another kind, patience is at its end, or it was cancelled.
  // Waits 0.1 s, then twice as long each time up to 5 s.
  absl::Status AfterBreak(const absl::Status& broken);

 private:
  Connection& connection_;
  Canceller& canceller_;
  const Duration patience_;
  BreakCallback& on_break_;
  Duration next_wait_;
  TimePoint give_up_;
};

}  // namespace lightstage::client
