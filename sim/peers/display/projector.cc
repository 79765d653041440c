#include "sim/peers/display/projector.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "base/status.h"
#include "sim/peers/display/xwd.h"

namespace lightstage::sim {
namespace {

// The projector's light is grey: of a coloured pixel its brightest channel.
uint8_t CodeOf(uint32_t pixel) {
  return static_cast<uint8_t>(std::max({pixel >> 16 & 0xff, pixel >> 8 & 0xff, pixel & 0xff}));
}

}  // namespace

VideoSink LightOf(std::shared_ptr<World> world) {
  return [world = std::move(world)](const PixelCodes& codes) {
    const TimePoint now = world->clock().Now();
    if (codes == nullptr) return world->EndProjector(now);
    world->RampProjection(now, now, codes);
  };
}

absl::StatusOr<std::unique_ptr<DisplayProjector>> DisplayProjector::Start(
    const std::string& x_display, int width, int height, VideoSink sink) {
  std::unique_ptr<DisplayProjector> projector(
      new DisplayProjector(x_display, width, height, std::move(sink)));
  absl::Status started;
  {
    MutexLock lock(&projector->mutex_);
    while (!projector->started_) projector->changed_.Wait(&projector->mutex_);
    started = *projector->started_;
  }
  RETURN_IF_ERROR(started);
  return projector;
}

DisplayProjector::DisplayProjector(std::string x_display, int width, int height, VideoSink sink)
    : x_display_(std::move(x_display)),
      width_(width),
      height_(height),
      sink_(std::move(sink)),
      thread_([this] { Run(); }) {}

DisplayProjector::~DisplayProjector() {
  {
    MutexLock lock(&mutex_);
    quit_ = true;
    changed_.SignalAll();
  }
  thread_.join();
  sink_(nullptr);
}

// The server ends with the thread that started it: this one starts all.
void DisplayProjector::Run() {
  MutexLock lock(&mutex_);
  while (!quit_) {
    const absl::Status served = Serve();
    if (!started_) {
      started_ = served;
      changed_.SignalAll();
    } else if (!served.ok()) {
      spdlog::error("the simulated projector's {}", MessageOf(served));
    }
    ScanOutLocked();
    changed_.WaitFor(&mutex_, FromSeconds(1 / kRefreshHz));
  }
}

absl::Status DisplayProjector::Serve() {
  if (server_ && !server_->Alive()) {
    spdlog::error("the simulated projector's X server has ended; it is started anew");
    server_.reset();
  }
  if (ended_) server_.reset();
  if (ended_ || server_) return absl::OkStatus();
  ASSIGN_OR_RETURN(XvfbProcess server, XvfbProcess::Start({width_, height_, false, x_display_}));
  server_.emplace(std::move(server));
  return absl::OkStatus();
}

void DisplayProjector::ScanOut() {
  MutexLock lock(&mutex_);
  ScanOutLocked();
}

void DisplayProjector::ScanOutLocked() {
  std::span<const uint8_t> screen;
  if (server_ && signal_) screen = server_->screen();
  if (std::equal(screen.begin(), screen.end(), scanned_.begin(), scanned_.end())) return;
  scanned_.assign(screen.begin(), screen.end());
  const absl::StatusOr<XwdPicture> picture = ParseXwd(scanned_);
  if (!picture.ok()) return sink_(nullptr);
  std::vector<uint8_t> codes(picture->pixels.size());
  std::transform(picture->pixels.begin(), picture->pixels.end(), codes.begin(), CodeOf);
  sink_(std::make_shared<const std::vector<uint8_t>>(std::move(codes)));
}

void DisplayProjector::EndServer(bool on) {
  MutexLock lock(&mutex_);
  ended_ = on;
  changed_.SignalAll();
}

void DisplayProjector::SuspendServer(bool on) {
  MutexLock lock(&mutex_);
  if (server_) server_->Suspend(on);
}

absl::Status DisplayProjector::SwitchOff(bool on) {
  MutexLock lock(&mutex_);
  return BreakSignal(on, &XvfbProcess::SwitchOff);
}

absl::Status DisplayProjector::ChangeMode(bool on) {
  MutexLock lock(&mutex_);
  return BreakSignal(on, &XvfbProcess::ChangeMode);
}

absl::Status DisplayProjector::BreakSignal(bool on, absl::Status (XvfbProcess::*change)()) {
  if (!server_) return absl::OkStatus();
  if (on) {
    RETURN_IF_ERROR(((*server_).*change)());
  } else {
    RETURN_IF_ERROR(server_->Restore());
  }
  // Only now: whoever asks for the mode because it is dark sees why.
  signal_ = !on;
  ScanOutLocked();
  return absl::OkStatus();
}

}  // namespace lightstage::sim
