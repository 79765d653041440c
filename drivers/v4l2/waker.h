// Wakes a thread that waits in poll(2). Thread-safe.
#pragma once

namespace lightstage {

class Waker {
 public:
  Waker();
  ~Waker();
  Waker(const Waker&) = delete;
  Waker& operator=(const Waker&) = delete;

  int fd() const { return fd_; }  // readable after Wake() until Clear()
  void Wake();
  void Clear();

 private:
  const int fd_;
};

}  // namespace lightstage
