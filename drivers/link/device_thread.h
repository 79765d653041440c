// The thread of a device whose calls block. It alone talks to the device; deadlines fire outside it, on the rig's clock, so that a
// device that does not answer never holds up a caller. Only opening and closing wait for it; the log says so, again and again, if that is long.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/functional/function_ref.h"
#include "base/mutex.h"
#include "drivers/link/outstanding.h"

namespace lightstage {

class DeviceThread {
 public:
  using Task = absl::AnyInvocable<void() &&>;

  // FAILED_PRECONDITION / DEVICE_UNSUITABLE on virtual time, where real hardware has no place.
  static absl::Status CheckClock(const DeviceContext& context);

  // `name` is the device's; the clock outlives it.
  DeviceThread(std::string name, Clock& clock);
  ~DeviceThread() { Close(); }
  DeviceThread(const DeviceThread&) = delete;
  DeviceThread& operator=(const DeviceThread&) = delete;

  const std::string& name() const { return name_; }
  Clock& clock() const { return clock_; }

  // ---- Any thread.

  // Runs `task` on the device's thread after those posted before. After Close() it is dropped.
  void Post(Task task);
  // The same, not before `time`; dropped too if Close() comes first.
  void PostAt(TimePoint time, Task task);
  // Runs `call` there and returns what it returned; at once if this is that thread.
  absl::Status Call(absl::FunctionRef<absl::Status()> call);

  // An operation of the contract: whoever completes it first wins, and at `deadline` it fails with Late(what).
  template <class T>
  std::shared_ptr<Operation<T>> Start(Completion<T> done, TimePoint deadline,
                                      std::string_view what) {
    auto operation = std::make_shared<Operation<T>>(std::move(done));
    Track(operation, deadline, what);
    return operation;
  }
  void Track(std::shared_ptr<Outstanding> operation, TimePoint deadline, std::string_view what);
  void FailAll(const absl::Status& status);

  // Fails what is outstanding with CANCELLED / DEVICE_CLOSED, runs the tasks that are due, ends the thread and waits for completions that
  // are running. To be called before what the tasks use is gone.
  void Close();

  // DEADLINE_EXCEEDED / DEVICE_SILENT: `what` was not confirmed in time.
  absl::Status Late(std::string_view what) const;

 private:
  void Run();
  // Until `over`.
  void AwaitLocked(const bool& over, std::string_view what) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::string name_;
  Clock& clock_;
  Mutex mutex_;
  CondVar changed_;
  std::deque<Task> tasks_ ABSL_GUARDED_BY(mutex_);
  std::multimap<TimePoint, Task> timed_ ABSL_GUARDED_BY(mutex_);
  bool quit_ ABSL_GUARDED_BY(mutex_) = false;
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<std::shared_ptr<Outstanding>> outstanding_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace lightstage
