// Control of the rig for as long as the object lives: taken, renewed on a thread of its own, given
// back.
#pragma once

#include <memory>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/functional/any_invocable.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "client/cpp/canceller.h"
#include "client/cpp/connection.h"

namespace lightstage::client {

// Thread-safe. The end of a lease, wanted or not, darkens the lamps and stops manual motion; a
// started run goes on.
class ControlLease {
 public:
  // Called once, on the lease's own thread, if control is lost before it was released. Must not
  // destroy the lease.
  using LostCallback = absl::AnyInvocable<void(const absl::Status&) &&>;

  // `owner` (1 to 200 characters) and `note` (at most 500) are shown to others. FAILED_PRECONDITION
  // / CONTROL_HELD if somebody has it. `connection` and `canceller` must outlive the lease;
  // `canceller` ends only the asking, not the renewing.
  static absl::StatusOr<std::unique_ptr<ControlLease>> Acquire(Connection& connection,
                                                               std::string owner, std::string note,
                                                               Canceller& canceller,
                                                               LostCallback on_lost = {});
  // Releases if it is still held.
  ~ControlLease();
  ControlLease(const ControlLease&) = delete;
  ControlLease& operator=(const ControlLease&) = delete;

  // To be given with calls that need control.
  const std::string& token() const { return token_; }

  // OK while held; then why it was lost: FAILED_PRECONDITION / CONTROL_LOST from the daemon, or
  // from here if no renewal got through for a heartbeat's time.
  absl::Status status() const;

  // Gives control back; once. OK if it was lost before.
  absl::Status Release();

 private:
  ControlLease(Connection& connection, std::string token, Duration heartbeat, TimePoint renewed,
               LostCallback on_lost);
  void Keep(TimePoint renewed);

  Connection& connection_;
  const std::string token_;
  const Duration heartbeat_;
  LostCallback on_lost_;  // used by the thread only
  Canceller ending_;      // ends the keeper's wait and its call
  mutable Mutex mutex_;
  absl::Status status_ ABSL_GUARDED_BY(mutex_);
  bool released_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread keeper_;
};

}  // namespace lightstage::client
