#include "drivers/display/display_link.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "absl/strings/str_format.h"
#include "drivers/display/raster.h"

namespace lightstage {

DisplayLink::DisplayLink(const DeviceContext& context, const DisplayOptions& options)
    : name_(context.name),
      options_(options),
      width_(context.geometry != nullptr ? context.geometry->projector.width : 0),
      height_(context.geometry != nullptr ? context.geometry->projector.height : 0) {}

absl::Status DisplayLink::Named(const absl::Status& status) const {
  return status.ok() ? status : Annotate(status, name_);
}

absl::Status DisplayLink::Connect() {
  screen_.reset();
  absl::StatusOr<std::unique_ptr<Screen>> screen = Screen::Open(options_.screen, width_, height_);
  if (!screen.ok()) return Named(screen.status());
  screen_ = *std::move(screen);
  const ScreenInfo& info = screen_->info();
  output_ = info.output;
  if (!std::exchange(opened_, true)) {
    spdlog::info("{}: output {} of {}x{} pixels at {}, drawn by {}", name_, info.output, info.width,
                 info.height,
                 info.refresh_hz > 0 ? absl::StrFormat("%.4g Hz", info.refresh_hz)
                                     : std::string("a rate that it does not tell"),
                 info.renderer);
    if (!info.note.empty()) spdlog::warn("{}: {}", name_, info.note);
    if (!info.paced) {
      spdlog::warn(
          "{}: output {} does not wait for its refresh when a picture is presented; the "
          "driver waits {:.3g} ms a frame itself",
          name_, info.output, 1000 / (info.refresh_hz > 0 ? info.refresh_hz : 60));
    }
  }
  return absl::OkStatus();
}

ProjectorInfo DisplayLink::info() const {
  ProjectorInfo info;
  info.identity.model = "output " + output_;
  info.width = width_;
  info.height = height_;
  info.settle = options_.settle;
  return info;
}

absl::Status DisplayLink::Show(const Pattern& pattern) {
  if (screen_ == nullptr) RETURN_IF_ERROR(Connect());
  absl::Status shown = screen_->Show(RasterOf(pattern, width_, height_, options_.gamma), 1);
  if (!shown.ok() && ErrorReason(shown) != "DEVICE_FAULT") screen_.reset();
  return Named(shown);
}

absl::Status DisplayLink::Check() {
  absl::Status same = screen_->Check();
  if (!same.ok() && ErrorReason(same) != "DEVICE_FAULT") screen_.reset();
  return Named(same);
}

}  // namespace lightstage
