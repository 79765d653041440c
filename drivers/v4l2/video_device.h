// A video device node as V4L2 sees it: ioctls, mapped memory, poll. Two implementations: V4l2Device (the kernel) and, in the tests, one
// that plays a camera.
#pragma once

#include <sys/types.h>

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"

namespace lightstage {

// One open node. One thread at a time. Closed by the destructor; what was mapped must have been unmapped before.
class VideoDevice {
 public:
  virtual ~VideoDevice() = default;

  // As ioctl(2), never blocking for a frame (DQBUF: EAGAIN). 0 or errno.
  virtual int Ioctl(unsigned long request, void* argument) = 0;

  // Maps a buffer that VIDIOC_QUERYBUF described. 0 or errno.
  virtual int Map(size_t length, off_t offset, std::span<std::byte>* memory) = 0;
  virtual void Unmap(std::span<std::byte> memory) = 0;

  enum class Readiness {
    kNothing,  // the time is over, or `wake_fd` became readable
    kFrame,    // DQBUF has something
    kError,    // POLLERR or POLLHUP: the stream is broken or the device gone; DQBUF says which
  };
  // Blocks at most `timeout`, or until `wake_fd` is readable. Does not read from `wake_fd`.
  virtual Readiness Wait(Duration timeout, int wake_fd) = 0;
};

// All nodes of this machine. Thread-safe.
class VideoSystem {
 public:
  virtual ~VideoSystem() = default;
  // Paths of the nodes that are there now, in order of their numbers.
  virtual std::vector<std::string> Paths() = 0;
  // 0 or errno.
  virtual int Open(const std::string& path, std::unique_ptr<VideoDevice>* device) = 0;
  // Who else has the node open, e.g. "firefox (process 4711)"; empty if that can not be seen.
  virtual std::string HoldersOf(const std::string& path) = 0;
};

}  // namespace lightstage
