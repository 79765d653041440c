#include "drivers/v4l2/video_port.h"

#include <cerrno>
#include <cstring>

namespace lightstage {

absl::StatusOr<VideoPort> VideoPort::Open(VideoSystem& system, const std::string& path,
                                          const std::string& name) {
  VideoPort port(system, path, name);
  const int error = system.Open(path, &port.device_);
  if (error == 0) return port;
  const ErrorMetadata metadata = {{"device", name}, {"path", path}};
  if (error == EACCES || error == EPERM) {
    return Error(absl::StatusCode::kPermissionDenied, "DEVICE_PERMISSION",
                 absl::StrCat(name, ": ", path,
                              " may not be opened; the daemon's user must be in group video"),
                 metadata);
  }
  if (error == ENOENT || error == ENODEV || error == ENXIO) {
    return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
                 absl::StrCat(name, ": there is no camera at ", path), metadata);
  }
  return port.ErrorOf(error, "opening");
}

absl::Status VideoPort::Call(unsigned long request, std::string_view what, void* argument) const {
  const int error = Try(request, argument);
  return error == 0 ? absl::OkStatus() : ErrorOf(error, what);
}

absl::Status VideoPort::ErrorOf(int error, std::string_view what) const {
  ErrorMetadata metadata = {{"device", name_}, {"path", path_}, {"operation", std::string(what)}};
  if (error == ENODEV || error == ENXIO) {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                 absl::StrCat(name_, ": the camera at ", path_,
                              " is gone; disarm and configure it to connect anew"),
                 metadata);
  }
  if (error == EBUSY) {
    const std::string holders = system_->HoldersOf(path_);
    metadata.emplace_back("holders", holders);
    // A USB camera whose control is not ready says the same.
    const std::string why = holders.empty()
                                ? " is busy: not ready, or in use by a program of another user"
                                : absl::StrCat(" is in use by ", holders);
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_BUSY",
                 absl::StrCat(name_, ": ", path_, why, " (", what, ")"), metadata);
  }
  std::string detail = std::strerror(error);
  if (error == ENOSPC) absl::StrAppend(&detail, " (the USB bus has too little bandwidth left)");
  metadata.emplace_back("detail", detail);
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
               absl::StrCat(name_, ": ", what, " of ", path_, " failed: ", detail), metadata);
}

absl::Status VideoPort::Refuse(std::string_view reason, std::string_view message) const {
  return Error(absl::StatusCode::kFailedPrecondition, reason, absl::StrCat(name_, ": ", message),
               {{"device", name_}, {"path", path_}, {"detail", std::string(message)}});
}

}  // namespace lightstage
