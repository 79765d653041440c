// Operations that must complete exactly once, whoever is first: the device's thread, the deadline's timer, Disarm, the
// destructor. Completions run without a lock held. Thread-safe.
#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "base/own_copy.h"
#include "drivers/api/camera.h"

namespace lightstage {

class Outstanding {
 public:
  virtual ~Outstanding() = default;

  // Completes with `status` unless complete. False if it was.
  virtual bool Fail(const absl::Status& status) = 0;
  // True from just before its last completion is called.
  bool finished() const {
    MutexLock lock(&mutex_);
    return finished_;
  }
  bool idle() const {
    MutexLock lock(&mutex_);
    return !delivering_;
  }
  // Blocks until no completion is running. Not from within one.
  void AwaitIdle() {
    MutexLock lock(&mutex_);
    while (delivering_) idle_.Wait(&mutex_);
  }

 protected:
  void SetDelivering(bool delivering) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    delivering_ = delivering;
    if (!delivering) idle_.SignalAll();
  }

  mutable Mutex mutex_;
  CondVar idle_;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  bool delivering_ ABSL_GUARDED_BY(mutex_) = false;  // a completion is being called
};

template <class T>
class Operation final : public Outstanding {
 public:
  explicit Operation(Completion<T> done) : done_(std::move(done)) {}

  bool Complete(absl::StatusOr<T> result) {
    {
      MutexLock lock(&mutex_);
      if (finished_) return false;
      finished_ = true;
      SetDelivering(true);
    }
    std::move(done_)(std::move(result));
    MutexLock lock(&mutex_);
    SetDelivering(false);
    return true;
  }
  bool Fail(const absl::Status& status) override { return Complete(OwnCopy(status)); }

 private:
  Completion<T> done_;  // touched by the one who set finished_
};

// One exposure: exposure_ended, then frame_ready. Whoever finishes it while exposure_ended is running leaves frame_ready to that
// thread, so that the order holds.
class CameraShot final : public Outstanding {
 public:
  CameraShot(Duration exposure, TimePoint deadline, Completion<ExposureEnd> ended,
             Completion<Frame> ready)
      : exposure(exposure),
        deadline(deadline),
        ended_(std::move(ended)),
        ready_(std::move(ready)) {}

  // At most the first call has an effect.
  void EndExposure(TimePoint time);
  // With an error exposure_ended fails too, unless it was called already.
  bool Finish(absl::StatusOr<Frame> frame);
  bool Fail(const absl::Status& status) override { return Finish(OwnCopy(status)); }

  const Duration exposure;
  const TimePoint deadline;
  // The device thread's notes.
  Duration used_exposure{};
  TimePoint sent{}, acknowledged{};  // of the trigger command

 private:
  void DeliverFrame() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  Completion<ExposureEnd> ended_;
  Completion<Frame> ready_;
  bool exposure_over_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<absl::StatusOr<Frame>> frame_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage
