// A full screen window on one output of this machine's graphics card, pixel for pixel, in a process of its own.
//
// Why a process: Xlib ends the process whose X server goes away, SDL has one video driver and one X server for a process and wants its
// main thread. So the window belongs to the program lightstage-screen, which this class starts: a display that dies takes that one
// with it and never the daemon, and any number of screens, on any servers, are open at a time. Pixels go by shared memory.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/clock.h"
#include "drivers/display/screen_wire.h"

namespace lightstage {

struct ScreenOptions {
  std::string backend = "x11";           // or "kmsdrm"
  std::string x_display;                 // X server; empty: the environment's DISPLAY
  std::string output;                    // name of the output; empty: by index
  int output_index = -1;                 // 0 …, in the order of ListOutputs()
  std::string renderer = "accelerated";  // or "software"
  int frames = 2;                        // presented before a raster counts as shown, ≥ 1
};

// One thread at a time, any thread.
class Screen {
 public:
  // Opens the window and shows black. The output's mode must be width × height: FAILED_PRECONDITION / DEVICE_UNSUITABLE naming both. NOT_FOUND /
  // DEVICE_NOT_FOUND if there is no such server or output; FAILED_PRECONDITION / DEVICE_FAULT if there is a compositor; DEADLINE_EXCEEDED /
  // DEVICE_SILENT after 8 s (kmsdrm: 30 s).
  static absl::StatusOr<std::unique_ptr<Screen>> Open(const ScreenOptions& options, int width,
                                                      int height);
  // Black, then the window is gone.
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // The outputs there are; nothing is changed.
  static absl::StatusOr<std::vector<ScreenInfo>> ListOutputs(const ScreenOptions& options);

  const ScreenInfo& info() const { return info_; }

  // Shows a raster of 1 (grey) or 3 (RGB) bytes a pixel, top row first, and returns when it was presented options.frames times, what was drawn
  // has been read back and equals it, and the output still has its mode. UNAVAILABLE / DEVICE_LOST if the output or the server is gone;
  // FAILED_PRECONDITION / DISPLAY_CHANGED naming both modes; FAILED_PRECONDITION / DEVICE_FAULT if something else is on the screen; DEADLINE_EXCEEDED /
  // DEVICE_SILENT if the server does not answer. After an error other than DEVICE_FAULT it is closed and good for nothing but the destructor.
  absl::Status Show(std::span<const uint8_t> raster, int channels);
  // OK if the output and the window have been there all the time since, in their mode. Errors as Show()'s.
  absl::Status Check();

 private:
  class Child;
  Screen(std::unique_ptr<Child> child, int width, int height, Duration patience);
  absl::Status Ask(char request);

  std::unique_ptr<Child> child_;  // nothing: closed
  const int width_, height_;
  const Duration patience_;
  ScreenInfo info_;
};

}  // namespace lightstage
