// What an X server says of its outputs (RandR 1.2) and what is really on its screen. For the screen process only: it has a connection of
// its own beside SDL's, because SDL notes outputs that come and go but not modes that change (SDL 2.26, X11_HandleXRandREvent).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "drivers/display/head.h"

namespace lightstage {

class X11Server {
 public:
  // `display` as for XOpenDisplay; empty: the environment's. From now on a broken connection ends the process with kDisplayGoneExit.
  static absl::StatusOr<std::unique_ptr<X11Server>> Connect(const std::string& display);
  ~X11Server();
  X11Server(const X11Server&) = delete;
  X11Server& operator=(const X11Server&) = delete;

  std::vector<Head> Heads();

  // That `head` is as it was: UNAVAILABLE / DEVICE_LOST, FAILED_PRECONDITION / DISPLAY_CHANGED naming both modes.
  absl::Status Check(const Head& head);

  // That the X screen shows `pixels` (0x00RRGGBB) where `head` looks: FAILED_PRECONDITION / DEVICE_FAULT naming the first pixel that differs.
  absl::Status CheckPixels(const Head& head, std::span<const uint32_t> pixels);

 private:
  explicit X11Server(void* display) : display_(display) {}
  void* const display_;  // Xlib's Display, whose header is full of macros
};

}  // namespace lightstage
