#include "client/cpp/control_lease.h"

#include <algorithm>
#include <utility>

#include "base/status.h"
#include "base/strings.h"

namespace lightstage::client {

absl::StatusOr<std::unique_ptr<ControlLease>> ControlLease::Acquire(Connection& connection,
                                                                    std::string owner,
                                                                    std::string note,
                                                                    Canceller& canceller,
                                                                    LostCallback on_lost) {
  v1::AcquireControlRequest request;
  request.set_owner(std::move(owner));
  request.set_note(std::move(note));
  // The lease runs at the latest from when it was asked for.
  TimePoint asked = connection.clock().Now();
  ASSIGN_OR_RETURN(
      v1::AcquireControlResponse response,
      Call(connection.rig(), &v1::RigService::Stub::AcquireControl, request, canceller));
  if (!(response.heartbeat_seconds() > 0) || response.heartbeat_seconds() > 86400) {
    return Error(absl::StatusCode::kInternal, "HEARTBEAT_INVALID",
                 absl::StrCat("the daemon asks for a heartbeat of ", response.heartbeat_seconds(),
                              " s; it should be above 0 and at most a day"),
                 {{"heartbeat_seconds", absl::StrCat(response.heartbeat_seconds())}});
  }
  return std::unique_ptr<ControlLease>(new ControlLease(connection, response.control_token(),
                                                        FromSeconds(response.heartbeat_seconds()),
                                                        asked, std::move(on_lost)));
}

ControlLease::ControlLease(Connection& connection, std::string token, Duration heartbeat,
                           TimePoint renewed, LostCallback on_lost)
    : connection_(connection),
      token_(std::move(token)),
      heartbeat_(heartbeat),
      on_lost_(std::move(on_lost)),
      ending_(connection.clock()),
      keeper_([this, renewed] { Keep(renewed); }) {}

ControlLease::~ControlLease() { Release().IgnoreError(); }

absl::Status ControlLease::status() const {
  MutexLock lock(&mutex_);
  return status_;
}

absl::Status ControlLease::Release() {
  {
    MutexLock lock(&mutex_);
    if (std::exchange(released_, true)) return absl::OkStatus();
  }
  ending_.Cancel();
  keeper_.join();
  if (!status().ok()) return absl::OkStatus();
  v1::ReleaseControlRequest request;
  request.set_control_token(token_);
  // Not cancellable: a lease that is given back on Ctrl-C must be given back. It ends by itself if
  // this fails.
  Canceller never(connection_.clock());
  absl::Status status = Call(connection_.rig(), &v1::RigService::Stub::ReleaseControl, request,
                             never, std::max<Duration>(heartbeat_, std::chrono::seconds(2)))
                            .status();
  return ErrorReason(status) == "CONTROL_LOST" ? absl::OkStatus() : status;
}

void ControlLease::Keep(TimePoint renewed) {
  Clock& clock = connection_.clock();
  v1::RenewControlRequest request;
  request.set_control_token(token_);
  absl::Status lost;
  TimePoint next = renewed + heartbeat_ / 3;
  while (lost.ok()) {
    if (ending_.SleepUntil(next)) return;
    TimePoint asked = clock.Now();
    next = asked + heartbeat_ / 3;
    TimePoint end = renewed + heartbeat_;
    absl::Status status = Call(connection_.rig(), &v1::RigService::Stub::RenewControl, request,
                               ending_, std::max<Duration>(end - asked, heartbeat_ / 10))
                              .status();
    if (ending_.cancelled()) return;
    if (status.ok()) {
      renewed = asked;
    } else if (!IsConnectionLost(status) && ErrorReason(status) != kNoAnswer) {
      lost = status;
    } else if (clock.Now() >= end) {
      lost = Error(absl::StatusCode::kFailedPrecondition, "CONTROL_LOST",
                   absl::StrCat("control was lost: no renewal reached the daemon for ",
                                Seconds(heartbeat_), " s (", status.message(), ")"),
                   {{"heartbeat_seconds", absl::StrCat(Seconds(heartbeat_))}});
    }
  }
  {
    MutexLock lock(&mutex_);
    status_ = lost;
  }
  if (on_lost_) std::move(on_lost_)(lost);
}

}  // namespace lightstage::client
