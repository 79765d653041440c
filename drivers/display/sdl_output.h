// The window on one output, by SDL. For the screen process only: on its main thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "drivers/display/head.h"
#include "drivers/display/kms_card.h"
#include "drivers/display/screen_wire.h"
#include "drivers/display/x11_server.h"

struct SDL_Window;
struct SDL_Renderer;
struct SDL_Texture;

namespace lightstage {

struct OutputOptions {
  std::string backend, x_display, output, renderer;  // as ScreenOptions
  int output_index = -1, frames = 2;
  int width = 0, height = 0;
};

class SdlOutput {
 public:
  // Errors as Screen::Open().
  static absl::StatusOr<std::unique_ptr<SdlOutput>> Open(const OutputOptions& options);
  ~SdlOutput();
  SdlOutput(const SdlOutput&) = delete;
  SdlOutput& operator=(const SdlOutput&) = delete;

  static absl::StatusOr<std::vector<ScreenInfo>> List(const std::string& backend,
                                                      const std::string& x_display);

  const ScreenInfo& info() const { return info_; }

  // Errors as Screen::Show(); `pixels` are 0x00RRGGBB.
  absl::Status Show(std::span<const uint32_t> pixels);
  // That the output shows what Show() gave it, and did all the time since: also DEVICE_FAULT if something was above it for a while.
  absl::Status Check();
  // Sees to events and that the output still has its mode; shows the last picture again where it was lost.
  absl::Status Idle();

 private:
  explicit SdlOutput(const OutputOptions& options) : options_(options) {}
  absl::Status Start();
  absl::Status OpenWindow();
  absl::Status Draw(std::span<const uint32_t> pixels);
  absl::Status CheckMode();
  absl::Status Pump();
  absl::Status Present(bool read_back);
  // Where presenting does not wait for the refresh: until the frame presented last has had one.
  void AwaitRefresh();
  absl::Status MeasurePacing();

  const OutputOptions options_;
  // One of the two, by the backend.
  std::unique_ptr<X11Server> server_;
  std::unique_ptr<KmsCard> card_;
  Head head_;
  ScreenInfo info_;
  std::chrono::steady_clock::time_point presented_{};
  SDL_Window* window_ = nullptr;
  SDL_Renderer* renderer_ = nullptr;
  SDL_Texture* texture_ = nullptr;
  std::vector<uint32_t> pixels_;     // shown last
  std::vector<uint32_t> read_back_;  // scratch
  uint32_t picture_ = 0;             // as the kernel numbers it: the one that was presented last
  bool stale_ = false;               // what was shown last may be gone from the screen
  bool covered_ = false;             // and was, since it was shown
  absl::Status touched_;             // what others did to the way of its codes since
};

}  // namespace lightstage
