// An open node with the names that its errors need.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "base/status.h"
#include "drivers/v4l2/video_device.h"

namespace lightstage {

class VideoPort {
 public:
  // `name` is the device's in the rig file. NOT_FOUND / DEVICE_NOT_FOUND, PERMISSION_DENIED / DEVICE_PERMISSION, or as Error() below.
  static absl::StatusOr<VideoPort> Open(VideoSystem& system, const std::string& path,
                                        const std::string& name);

  VideoDevice& device() const { return *device_; }
  const std::string& path() const { return path_; }
  const std::string& name() const { return name_; }

  // One ioctl; `what` is its name.
  absl::Status Call(unsigned long request, std::string_view what, void* argument) const;
  // The same, as errno.
  int Try(unsigned long request, void* argument) const { return device_->Ioctl(request, argument); }

  // What `error` (errno) of `what` means: UNAVAILABLE / DEVICE_LOST, FAILED_PRECONDITION / DEVICE_BUSY with who has it, else
  // FAILED_PRECONDITION / DEVICE_FAULT.
  absl::Status ErrorOf(int error, std::string_view what) const;
  // FAILED_PRECONDITION / `reason`.
  absl::Status Refuse(std::string_view reason, std::string_view message) const;

 private:
  VideoPort(VideoSystem& system, std::string path, std::string name)
      : system_(&system), path_(std::move(path)), name_(std::move(name)) {}

  VideoSystem* system_;
  std::string path_, name_;
  std::unique_ptr<VideoDevice> device_;
};

}  // namespace lightstage
