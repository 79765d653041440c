#include "drivers/v4l2/waker.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>

namespace lightstage {

// Where there is none left, poll(2) passes over it and the wait ends with its timeout.
Waker::Waker() : fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

Waker::~Waker() {
  if (fd_ >= 0) close(fd_);
}

void Waker::Wake() {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(fd_, &one, sizeof one);
}

void Waker::Clear() {
  uint64_t count;
  [[maybe_unused]] const ssize_t taken = read(fd_, &count, sizeof count);
}

}  // namespace lightstage
