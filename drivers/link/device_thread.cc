#include "drivers/link/device_thread.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace lightstage {
namespace {

constexpr Duration kLongCall = std::chrono::seconds(5);

}  // namespace

absl::Status DeviceThread::CheckClock(const DeviceContext& context) {
  if (!context.clock->is_virtual()) return absl::OkStatus();
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
               absl::StrCat(context.name, ": a real device can not run on virtual time"),
               {{"device", context.name}});
}

DeviceThread::DeviceThread(std::string name, Clock& clock)
    : name_(std::move(name)), clock_(clock), thread_([this] { Run(); }) {}

void DeviceThread::Post(Task task) {
  MutexLock lock(&mutex_);
  if (quit_) return;
  tasks_.push_back(std::move(task));
  changed_.SignalAll();
}

void DeviceThread::PostAt(TimePoint time, Task task) {
  MutexLock lock(&mutex_);
  if (quit_) return;
  timed_.emplace(time, std::move(task));
  changed_.SignalAll();
}

absl::Status DeviceThread::Call(absl::FunctionRef<absl::Status()> call) {
  if (std::this_thread::get_id() == thread_.get_id()) return call();
  absl::Status status;
  bool done = false;
  MutexLock lock(&mutex_);
  if (quit_) {
    return Error(absl::StatusCode::kCancelled, "DEVICE_CLOSED", absl::StrCat(name_, " is closed"),
                 {{"device", name_}});
  }
  tasks_.emplace_back([&] {
    absl::Status result = call();
    MutexLock inner(&mutex_);
    status = std::move(result);
    done = true;
    changed_.SignalAll();
  });
  changed_.SignalAll();
  AwaitLocked(done, "its driver's call");
  return status;
}

void DeviceThread::AwaitLocked(const bool& over, std::string_view what) {
  const TimePoint begin = clock_.Now();
  TimePoint next = begin + kLongCall;
  while (!over) {
    changed_.WaitFor(&mutex_,
                     std::max<Duration>(next - clock_.Now(), std::chrono::milliseconds(1)));
    if (over || clock_.Now() < next) continue;
    spdlog::warn("{}: {} has not come back for {:.0f} s: is the device or its bus stuck?", name_,
                 what, Seconds(next - begin));
    next += kLongCall;
  }
}

void DeviceThread::Track(std::shared_ptr<Outstanding> operation, TimePoint deadline,
                         std::string_view what) {
  if (deadline != kNever) {
    clock_.At(deadline, [weak = std::weak_ptr<Outstanding>(operation), error = Late(what)] {
      if (std::shared_ptr<Outstanding> late = weak.lock()) late->Fail(error);
    });
  }
  MutexLock lock(&mutex_);
  outstanding_.erase(std::remove_if(outstanding_.begin(), outstanding_.end(),
                                    [](const auto& o) { return o->finished() && o->idle(); }),
                     outstanding_.end());
  outstanding_.push_back(std::move(operation));
}

void DeviceThread::FailAll(const absl::Status& status) {
  std::vector<std::shared_ptr<Outstanding>> all;
  {
    MutexLock lock(&mutex_);
    all = outstanding_;
  }
  for (const auto& operation : all) operation->Fail(status);
}

void DeviceThread::Close() {
  FailAll(Error(absl::StatusCode::kCancelled, "DEVICE_CLOSED", absl::StrCat(name_, ": closed"),
                {{"device", name_}}));
  {
    MutexLock lock(&mutex_);
    quit_ = true;
    changed_.SignalAll();
    AwaitLocked(ended_, "the call that it is to be closed after");
  }
  if (thread_.joinable()) thread_.join();
  std::vector<std::shared_ptr<Outstanding>> last;
  {
    MutexLock lock(&mutex_);
    last.swap(outstanding_);
  }
  // Their timers, or whoever interrupted them, may be calling completions.
  for (const auto& operation : last) operation->AwaitIdle();
}

absl::Status DeviceThread::Late(std::string_view what) const {
  return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
               absl::StrCat(name_, ": ", what, " was not confirmed in time"),
               {{"device", name_}, {"operation", std::string(what)}});
}

void DeviceThread::Run() {
  MutexLock lock(&mutex_);
  while (true) {
    // What is due goes behind what was posted before it was.
    while (!quit_ && !timed_.empty() && timed_.begin()->first <= clock_.Now()) {
      tasks_.push_back(std::move(timed_.begin()->second));
      timed_.erase(timed_.begin());
    }
    if (tasks_.empty()) {
      if (quit_) {
        ended_ = true;
        changed_.SignalAll();
        return;
      }
      if (timed_.empty()) {
        changed_.Wait(&mutex_);
      } else {
        changed_.WaitFor(&mutex_, timed_.begin()->first - clock_.Now());
      }
      continue;
    }
    Task task = std::move(tasks_.front());
    tasks_.pop_front();
    mutex_.Unlock();
    std::move(task)();
    task = {};  // what it held goes outside the lock
    mutex_.Lock();
  }
}

}  // namespace lightstage
