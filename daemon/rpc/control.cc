#include "daemon/rpc/control.h"

#include <random>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "base/utf8.h"
#include "spdlog/spdlog.h"

namespace lightstage::rpc {
namespace {

// From the system's generator, not the injected one: a token must not be guessable.
std::string NewToken() {
  std::random_device random;
  return absl::StrFormat("%08x%08x%08x%08x", random(), random(), random(), random());
}

}  // namespace

Control::Control(Clock& clock, Duration heartbeat, std::function<void(std::string_view)> lost)
    : clock_(clock),
      heartbeat_(heartbeat),
      lost_(std::move(lost)),
      watcher_([this] { WatchExpiry(); }) {}

Control::~Control() {
  {
    MutexLock lock(&mutex_);
    quit_ = true;
    changed_.SignalAll();
  }
  watcher_.join();
}

absl::StatusOr<std::string> Control::Acquire(std::string owner, std::string note) {
  if (owner.empty() || owner.size() > 200 || note.size() > 500) {
    return Error(absl::StatusCode::kInvalidArgument, "OWNER_INVALID",
                 absl::StrFormat("control: owner must have 1 to 200 characters (has %d), note at "
                                 "most 500 (has %d)",
                                 owner.size(), note.size()),
                 {{"owner", CutUtf8(owner, 200)}});
  }
  MutexLock lock(&mutex_);
  if (!token_.empty() || ending_) {
    return Error(absl::StatusCode::kFailedPrecondition, "CONTROL_HELD",
                 absl::StrFormat("control is held by %s%s%s; ask them, or wait until they are done",
                                 owner_, note_.empty() ? "" : ": ", note_),
                 {{"owner", owner_}, {"note", note_}});
  }
  token_ = NewToken();
  owner_ = std::move(owner);
  note_ = std::move(note);
  expires_ = clock_.Now() + heartbeat_;
  changed_.SignalAll();
  spdlog::info("control: taken by {} ({})", owner_, note_);
  return token_;
}

absl::Status Control::CheckLocked(const std::string& token) const {
  if (token.empty()) {
    return Error(absl::StatusCode::kFailedPrecondition, "CONTROL_REQUIRED",
                 "this call needs control; acquire it first");
  }
  if (token != token_ || ending_ || clock_.Now() > expires_) {
    return Error(absl::StatusCode::kFailedPrecondition, "CONTROL_LOST",
                 absl::StrFormat("control was lost (no renewal within %g s) or never held; acquire "
                                 "it again",
                                 Seconds(heartbeat_)),
                 {{"heartbeat_seconds", absl::StrCat(Seconds(heartbeat_))}});
  }
  return absl::OkStatus();
}

absl::Status Control::Check(const std::string& token) const {
  MutexLock lock(&mutex_);
  return CheckLocked(token);
}

absl::StatusOr<WallTime> Control::Renew(const std::string& token) {
  MutexLock lock(&mutex_);
  RETURN_IF_ERROR(CheckLocked(token));
  expires_ = clock_.Now() + heartbeat_;
  changed_.SignalAll();
  return clock_.WallNow() + std::chrono::duration_cast<std::chrono::microseconds>(heartbeat_);
}

absl::Status Control::Release(const std::string& token) {
  {
    MutexLock lock(&mutex_);
    RETURN_IF_ERROR(CheckLocked(token));
    ending_ = true;
  }
  End("released");
  return absl::OkStatus();
}

// The caller has set ending_.
void Control::End(std::string_view why) {
  lost_(why);
  spdlog::info("control: {}", why);
  MutexLock lock(&mutex_);
  token_.clear();
  owner_.clear();
  note_.clear();
  ending_ = false;
  changed_.SignalAll();
}

std::optional<Control::Holder> Control::holder() const {
  MutexLock lock(&mutex_);
  if (token_.empty()) return std::nullopt;
  return Holder{owner_, note_,
                clock_.WallNow() +
                    std::chrono::duration_cast<std::chrono::microseconds>(expires_ - clock_.Now())};
}

void Control::WatchExpiry() {
  MutexLock lock(&mutex_);
  while (!quit_) {
    if (token_.empty() || ending_) {
      changed_.Wait(&mutex_);
      continue;
    }
    Duration left = expires_ - clock_.Now();
    if (left > Duration::zero()) {
      changed_.WaitFor(&mutex_, left);
      continue;
    }
    ending_ = true;
    mutex_.Unlock();
    End("lost: no renewal within the heartbeat");
    mutex_.Lock();
  }
}

}  // namespace lightstage::rpc
