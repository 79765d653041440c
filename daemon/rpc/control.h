// The control lease: one client at a time, kept alive by a heartbeat in wall time. Thread-safe.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/mutex.h"

namespace lightstage::rpc {

class Control {
 public:
  struct Holder {
    std::string owner, note;
    WallTime expires;
  };
  // `lost(why)` is called, on a thread of the lease's own or of the caller, when a lease ends for whatever reason; a new one
  // can be had only after it returned. The clock is a real one even where the rig's is virtual: clients live in wall time.
  Control(Clock& clock, Duration heartbeat, std::function<void(std::string_view why)> lost);
  ~Control();

  // The token. INVALID_ARGUMENT / OWNER_MISSING; FAILED_PRECONDITION / CONTROL_HELD.
  absl::StatusOr<std::string> Acquire(std::string owner, std::string note);
  // When it ends unless renewed. FAILED_PRECONDITION / CONTROL_LOST.
  absl::StatusOr<WallTime> Renew(const std::string& token);
  absl::Status Release(const std::string& token);
  // OK if `token` is the lease. FAILED_PRECONDITION: CONTROL_REQUIRED (empty), CONTROL_LOST.
  absl::Status Check(const std::string& token) const;
  std::optional<Holder> holder() const;
  Duration heartbeat() const { return heartbeat_; }

 private:
  absl::Status CheckLocked(const std::string& token) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void End(std::string_view why);
  void WatchExpiry();

  Clock& clock_;
  const Duration heartbeat_;
  const std::function<void(std::string_view)> lost_;
  mutable Mutex mutex_;
  CondVar changed_;
  std::string token_ ABSL_GUARDED_BY(mutex_);
  std::string owner_ ABSL_GUARDED_BY(mutex_), note_ ABSL_GUARDED_BY(mutex_);
  TimePoint expires_ ABSL_GUARDED_BY(mutex_){};
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;
  bool quit_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread watcher_;
};

}  // namespace lightstage::rpc
