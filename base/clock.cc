#include "base/clock.h"

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "base/status.h"
#include "base/strings.h"

namespace lightstage {

std::string FormatUtc(WallTime t) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E6SZ", absl::FromChrono(t), absl::UTCTimeZone());
}

absl::StatusOr<WallTime> ParseUtc(std::string_view text) {
  absl::Time time;
  std::string error;
  if (!absl::ParseTime(absl::RFC3339_full, AbslView(text), &time, &error)) {
    return Error(absl::StatusCode::kInvalidArgument, "TIME_INVALID",
                 absl::StrCat("'", text, "' is no RFC 3339 time: ", error),
                 {{"time", std::string(text)}});
  }
  return std::chrono::time_point_cast<std::chrono::microseconds>(absl::ToChronoTime(time));
}

void SleepFor(Clock& clock, Duration d) {
  clock.WaitUntil(clock.Now() + d, [] { return false; });
}

// ---- RealClock

RealClock::RealClock() : thread_([this] { RunTimers(); }) {}

RealClock::~RealClock() {
  {
    MutexLock lock(&mutex_);
    quit_ = true;
    timers_changed_.SignalAll();
  }
  thread_.join();
}

TimePoint RealClock::Now() const {
  return TimePoint(
      std::chrono::duration_cast<Duration>(std::chrono::steady_clock::now().time_since_epoch()));
}

WallTime RealClock::WallNow() const {
  return std::chrono::time_point_cast<std::chrono::microseconds>(std::chrono::system_clock::now());
}

Clock::TimerId RealClock::At(TimePoint t, Callback fn) {
  MutexLock lock(&mutex_);
  TimerId id{t, next_id_++};
  bool first = timers_.empty() || id < timers_.begin()->first;
  timers_.emplace(id, std::move(fn));
  if (first) timers_changed_.Signal();
  return id;
}

bool RealClock::Cancel(TimerId id) {
  MutexLock lock(&mutex_);
  return timers_.erase(id) > 0;
}

void RealClock::RunTimers() {
  MutexLock lock(&mutex_);
  while (!quit_) {
    if (timers_.empty()) {
      timers_changed_.Wait(&mutex_);
      continue;
    }
    Duration left = timers_.begin()->first.first - Now();
    if (left > Duration::zero()) {
      timers_changed_.WaitFor(&mutex_, left);
      continue;
    }
    auto timer = timers_.extract(timers_.begin());
    mutex_.Unlock();
    std::move(timer.mapped())();
    mutex_.Lock();
  }
}

bool RealClock::WaitUntil(TimePoint deadline, absl::FunctionRef<bool()> ready) {
  if (ready()) return true;
  MutexLock lock(&mutex_);
  while (true) {
    uint64_t seen = generation_;
    mutex_.Unlock();
    bool now_ready = ready();
    mutex_.Lock();
    if (now_ready) return true;
    if (generation_ != seen) continue;
    if (deadline == kNever) {
      changed_.Wait(&mutex_);
      continue;
    }
    Duration left = deadline - Now();
    if (left <= Duration::zero()) return false;
    changed_.WaitFor(&mutex_, left);
  }
}

void RealClock::Notify() {
  MutexLock lock(&mutex_);
  ++generation_;
  changed_.SignalAll();
}

// ---- VirtualClock

VirtualClock::VirtualClock(WallTime wall_epoch) : wall_epoch_(wall_epoch) {}

TimePoint VirtualClock::Now() const {
  MutexLock lock(&mutex_);
  return now_;
}

WallTime VirtualClock::WallNow() const {
  return wall_epoch_ +
         std::chrono::duration_cast<std::chrono::microseconds>(Now().time_since_epoch());
}

Clock::TimerId VirtualClock::At(TimePoint t, Callback fn) {
  MutexLock lock(&mutex_);
  TimerId id{std::max(t, now_), next_id_++};
  timers_.emplace(id, std::move(fn));
  changed_.SignalAll();
  return id;
}

bool VirtualClock::Cancel(TimerId id) {
  MutexLock lock(&mutex_);
  return timers_.erase(id) > 0;
}

bool VirtualClock::WaitUntil(TimePoint deadline, absl::FunctionRef<bool()> ready) {
  if (ready()) return true;
  MutexLock lock(&mutex_);
  while (true) {
    uint64_t seen = generation_;
    mutex_.Unlock();
    bool now_ready = ready();
    mutex_.Lock();
    if (now_ready) return true;
    if (generation_ != seen) continue;
    if (driving_) {
      changed_.Wait(&mutex_);
      continue;
    }
    if (timers_.empty() || timers_.begin()->first.first > deadline) {
      if (deadline == kNever) {
        changed_.Wait(&mutex_);  // nothing is due: only another thread can help
        continue;
      }
      now_ = std::max(now_, deadline);
      return false;
    }
    auto timer = timers_.extract(timers_.begin());
    now_ = std::max(now_, timer.key().first);
    driving_ = true;
    mutex_.Unlock();
    std::move(timer.mapped())();
    mutex_.Lock();
    driving_ = false;
    ++generation_;
    changed_.SignalAll();
  }
}

void VirtualClock::Notify() {
  MutexLock lock(&mutex_);
  ++generation_;
  changed_.SignalAll();
}

}  // namespace lightstage
