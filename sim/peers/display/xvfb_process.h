// An X server with a screen in memory (Xvfb, package xvfb), whose pixels can be read past all its clients.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace lightstage {

struct XvfbOptions {
  int width = 0, height = 0;
  bool cursor = false;  // its pointer stands in the middle and is drawn
  std::string display;  // ":7"; empty: one that is free
};

class XvfbProcess {
 public:
  // Returns once it listens. The server ends with the thread that starts it, at the latest.
  static absl::StatusOr<XvfbProcess> Start(const XvfbOptions& options);
  XvfbProcess(XvfbProcess&& other) noexcept;
  XvfbProcess& operator=(XvfbProcess&&) = delete;
  ~XvfbProcess();

  const std::string& display() const { return display_; }  // ":7"
  // The screen as the server has it in memory, an XWD file (xwd.h) that changes as its clients draw; still there when the server is
  // gone.
  std::span<const uint8_t> screen() const { return screen_; }

  // False once it has ended by itself.
  bool Alive();
  void Kill();
  void Suspend(bool asleep);  // it is there, but does not answer
  // As the program xrandr does it (package x11-xserver-utils), for the only output: switched off; one pixel narrower than it was; as at the
  // start. FAILED_PRECONDITION / PEER_XRANDR if the server would not.
  absl::Status SwitchOff();
  absl::Status ChangeMode();
  absl::Status Restore();

 private:
  XvfbProcess() = default;
  absl::Status MapScreen(const std::string& folder);
  absl::Status Xrandr(const std::vector<std::string>& arguments);

  pid_t pid_ = -1;
  std::string display_;
  int width_ = 0, height_ = 0;
  std::span<const uint8_t> screen_;
};

}  // namespace lightstage
