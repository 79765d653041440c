// What an X server says of its outputs (RandR 1.2) and what is really on its screen. For the screen process only: it has a connection of
// its own beside SDL's, because SDL notes outputs that come and go but not modes that change (SDL 2.26, X11_HandleXRandREvent).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "drivers/display/colour_blobs.h"
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

  // Wakes the outputs and keeps them awake (DPMS).
  void KeepAwake();

  // Gives `head` a gamma table that leaves codes as they are, if it has another. It keeps it: giving back what it had before would take it from who
  // opens next.
  void Straighten(const Head& head);

  // That `head` is as it was and lit: UNAVAILABLE / DEVICE_LOST, FAILED_PRECONDITION / DISPLAY_CHANGED naming both modes.
  absl::Status Check(const Head& head);

  // That codes and pixels come out of it as they are, by nobody else's hand: FAILED_PRECONDITION / DEVICE_FAULT if its gamma table is not straight or a
  // compositor is there.
  absl::Status CheckUntouched(const Head& head);

  // That the X screen shows `pixels` (0x00RRGGBB) where `head` looks: FAILED_PRECONDITION / DEVICE_FAULT naming the first pixel that differs.
  absl::Status CheckPixels(const Head& head, std::span<const uint32_t> pixels);

 private:
  explicit X11Server(void* display) : display_(display) {}
  absl::Status CheckAwake(const Head& head);
  std::vector<ColourEntry> Gamma(uint64_t crtc) const;  // empty if it has none

  void* const display_;  // Xlib's Display, whose header is full of macros
};

}  // namespace lightstage
