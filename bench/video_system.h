// The kernel's video nodes, with a tally of what a driver asks of them.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "drivers/v4l2/v4l2_device.h"

namespace lightstage::bench {

// Hands everything on; what is derived from it notes the ioctls.
class ForwardingDevice : public VideoDevice {
 public:
  explicit ForwardingDevice(std::unique_ptr<VideoDevice> device) : device_(std::move(device)) {}
  int Ioctl(unsigned long request, void* argument) override {
    return device_->Ioctl(request, argument);
  }
  int Map(size_t length, off_t offset, std::span<std::byte>* memory) override {
    return device_->Map(length, offset, memory);
  }
  void Unmap(std::span<std::byte> memory) override { device_->Unmap(memory); }
  Readiness Wait(Duration timeout, int wake_fd) override { return device_->Wait(timeout, wake_fd); }

 private:
  const std::unique_ptr<VideoDevice> device_;
};

// All nodes as `Device`, made of the kernel's one and the tally.
template <class Device, class Tally>
class TalliedSystem final : public VideoSystem {
 public:
  std::vector<std::string> Paths() override { return V4l2System::Instance().Paths(); }
  int Open(const std::string& path, std::unique_ptr<VideoDevice>* device) override {
    const int error = V4l2System::Instance().Open(path, device);
    if (error == 0) *device = std::make_unique<Device>(std::move(*device), tally);
    return error;
  }
  std::string HoldersOf(const std::string& path) override {
    return V4l2System::Instance().HoldersOf(path);
  }
  Tally tally{};
};

}  // namespace lightstage::bench
