// A bounded first-in first-out queue between threads. Producers wait when it is full: nothing is dropped, memory stays bounded.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"

namespace lightstage {

template <class T>
class BoundedQueue {
 public:
  explicit BoundedQueue(size_t capacity) : capacity_(capacity) {}

  // Waits for room. False if the queue was closed: the item was not taken.
  bool Push(T item) {
    MutexLock lock(&mutex_);
    while (!closed_ && items_.size() >= capacity_) room_.Wait(&mutex_);
    if (closed_) return false;
    items_.push_back(std::move(item));
    available_.Signal();
    return true;
  }

  // Waits for room at most so long. False if there was none: `item` is as it was.
  bool PushFor(T& item, std::chrono::nanoseconds patience) {
    const auto begin = std::chrono::steady_clock::now();
    MutexLock lock(&mutex_);
    while (!closed_ && items_.size() >= capacity_) {
      auto left = patience - (std::chrono::steady_clock::now() - begin);
      if (left <= left.zero()) return false;
      room_.WaitFor(&mutex_, std::min<std::chrono::nanoseconds>(left, std::chrono::hours(1)));
    }
    if (closed_) return false;
    items_.push_back(std::move(item));
    available_.Signal();
    return true;
  }

  // Waits for an item. Nothing once the queue is closed and empty.
  std::optional<T> Pop() {
    MutexLock lock(&mutex_);
    while (!closed_ && items_.empty()) available_.Wait(&mutex_);
    return TakeLocked();
  }

  std::optional<T> TryPop() {
    MutexLock lock(&mutex_);
    return TakeLocked();
  }

  // No more pushes; what is inside can still be popped.
  void Close() {
    MutexLock lock(&mutex_);
    closed_ = true;
    room_.SignalAll();
    available_.SignalAll();
  }

  size_t size() const {
    MutexLock lock(&mutex_);
    return items_.size();
  }

 private:
  std::optional<T> TakeLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (items_.empty()) return std::nullopt;
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    room_.Signal();
    return item;
  }

  const size_t capacity_;
  mutable Mutex mutex_;
  CondVar room_, available_;
  std::deque<T> items_ ABSL_GUARDED_BY(mutex_);
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace lightstage
