#include "client/cpp/retry.h"

#include <algorithm>

#include "base/status.h"

namespace lightstage::client {
namespace {

constexpr Duration kFirstWait = std::chrono::milliseconds(100);
constexpr Duration kLongestWait = std::chrono::seconds(5);

}  // namespace

Retry::Retry(Connection& connection, Canceller& canceller, Duration patience,
             BreakCallback& on_break)
    : connection_(connection), canceller_(canceller), patience_(patience), on_break_(on_break) {
  Progressed();
}

void Retry::Progressed() {
  next_wait_ = kFirstWait;
  give_up_ = connection_.clock().Now() + patience_;
}

absl::Status Retry::AfterBreak(const absl::Status& broken) {
  if (!IsConnectionLost(broken)) return broken;
  if (on_break_) on_break_(broken);
  Clock& clock = connection_.clock();
  if (clock.Now() >= give_up_) return broken;
  if (canceller_.SleepUntil(std::min(clock.Now() + next_wait_, give_up_))) {
    return Error(absl::StatusCode::kCancelled, kCancelled, "cancelled");
  }
  next_wait_ = std::min(2 * next_wait_, kLongestWait);
  return connection_.WaitReady(give_up_, /*patient=*/true, canceller_);
}

}  // namespace lightstage::client
