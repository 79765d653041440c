// Video device nodes of the kernel. Nothing is interpreted here.
#pragma once

#include "drivers/v4l2/video_device.h"

namespace lightstage {

class V4l2Device final : public VideoDevice {
 public:
  static int Open(const std::string& path, std::unique_ptr<VideoDevice>* device);
  ~V4l2Device() override;
  V4l2Device(const V4l2Device&) = delete;
  V4l2Device& operator=(const V4l2Device&) = delete;

  int Ioctl(unsigned long request, void* argument) override;
  int Map(size_t length, off_t offset, std::span<std::byte>* memory) override;
  void Unmap(std::span<std::byte> memory) override;
  Readiness Wait(Duration timeout, int wake_fd) override;

 private:
  explicit V4l2Device(int fd) : fd_(fd) {}
  const int fd_;
};

class V4l2System final : public VideoSystem {
 public:
  static V4l2System& Instance();
  std::vector<std::string> Paths() override;
  int Open(const std::string& path, std::unique_ptr<VideoDevice>* device) override;
  std::string HoldersOf(const std::string& path) override;
};

// The processes below `proc` ("/proc") that have the file `path` open, except `self`: "name (process 4711), …". Those of other users
// can be seen by root only.
std::string ProcessesWithFile(const std::string& proc, const std::string& path, int self);

}  // namespace lightstage
