// For tests: an X server with a screen in memory (Xvfb), whose pixels can be read past all clients.
#pragma once

#include <sys/types.h>

#include <string>

#include "absl/status/statusor.h"
#include "drivers/display/xwd.h"

namespace lightstage {

class XvfbProcess {
 public:
  // Returns once it listens. Needs the package xvfb. Its pointer stands in the middle; without `cursor` it is never drawn.
  static absl::StatusOr<XvfbProcess> Start(int width, int height, bool cursor = false);
  XvfbProcess(XvfbProcess&& other) noexcept;
  XvfbProcess& operator=(XvfbProcess&&) = delete;
  ~XvfbProcess();

  const std::string& display() const { return display_; }  // ":7"
  // What is on the screen.
  absl::StatusOr<XwdPicture> Picture() const;

  void Kill();
  void Suspend(bool asleep);  // it is there, but does not answer

 private:
  XvfbProcess() = default;
  pid_t pid_ = -1;
  std::string display_, folder_;
};

}  // namespace lightstage
