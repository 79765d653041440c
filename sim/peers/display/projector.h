// A projector that hangs on an output of a graphics card: an X server of its own with a screen in memory, scanned out at the refresh rate.
// What shines is what the pixels say, whoever drew them.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
#include "sim/peers/display/xvfb_process.h"
#include "sim/rig/video.h"

namespace lightstage::sim {

// The light of the simulated rig's projector.
VideoSink LightOf(std::shared_ptr<World> world);

// Thread-safe.
class DisplayProjector {
 public:
  static constexpr double kRefreshHz = 60;

  // Serves `x_display` (":7"), whose one output, "screen", has this mode. Errors as XvfbProcess::Start.
  static absl::StatusOr<std::unique_ptr<DisplayProjector>> Start(const std::string& x_display,
                                                                 int width, int height,
                                                                 VideoSink sink);
  // Dark.
  ~DisplayProjector();
  DisplayProjector(const DisplayProjector&) = delete;
  DisplayProjector& operator=(const DisplayProjector&) = delete;

  // Scans the screen out now, between two refreshes. A projector's electronics are never late, but a thread of a busy machine may be.
  void ScanOut();

  // ---- Faults, until they are mended: without a signal that it knows, the projector is dark.

  void EndServer(bool on);      // the X server is gone; mended: another one is there
  void SuspendServer(bool on);  // it does not answer; the screen stays as it is
  absl::Status SwitchOff(bool on);
  absl::Status ChangeMode(bool on);

 private:
  DisplayProjector(std::string x_display, int width, int height, VideoSink sink);
  void Run();
  // A server, if there is to be one and is none.
  absl::Status Serve() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void ScanOutLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status BreakSignal(bool on, absl::Status (XvfbProcess::*change)())
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const std::string x_display_;
  const int width_, height_;
  const VideoSink sink_;
  Mutex mutex_;
  CondVar changed_;
  bool quit_ ABSL_GUARDED_BY(mutex_) = false;
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;                   // the server is not to be there
  bool signal_ ABSL_GUARDED_BY(mutex_) = true;                   // a mode that the projector knows
  std::optional<XvfbProcess> server_ ABSL_GUARDED_BY(mutex_);    // the thread's
  std::optional<absl::Status> started_ ABSL_GUARDED_BY(mutex_);  // of the first one
  std::vector<uint8_t> scanned_
      ABSL_GUARDED_BY(mutex_);  // the last picture, as it was in memory; nothing: dark
  std::thread thread_;
};

}  // namespace lightstage::sim
