#include "daemon/rig/bracket.h"

#include "absl/strings/str_format.h"

namespace lightstage {

Bracket::Bracket(Rig& rig, std::vector<Duration> exposures, uint64_t since)
    : rig_(rig), exposures_(std::move(exposures)), since_(since) {
  frames_.reserve(exposures_.size());
}

absl::Status Bracket::Expose() {
  Camera& camera = rig_.camera();
  for (size_t i = 0; i < exposures_.size(); ++i) {
    if (i > 0) RETURN_IF_ERROR(TakeFrame());  // one frame at a time is what cameras promise
    RETURN_IF_ERROR(rig_.CheckUndisturbed(since_));
    Duration exposure = exposures_[i];
    last_deadline_ = rig_.clock().Now() + exposure + camera.info().readout + rig_.device_timeout();
    Pending<ExposureEnd> ended(rig_.clock());
    last_.emplace(rig_.clock());
    camera.Trigger(exposure, last_deadline_, ended.sink(), last_->sink());
    // The driver's own deadline is the same; the margin lets its more telling error arrive first.
    auto end = ended.Wait(last_deadline_ + rig_.device_timeout(), "camera: exposure");
    if (!end.ok()) {
      rig_.SuspectCamera();
      return Annotate(end.status(),
                      absl::StrFormat("camera: exposure of %g us", Seconds(exposure) * 1e6));
    }
  }
  absl::Status as_told = rig_.CheckLight();
  if (as_told.ok()) as_told = rig_.CheckUndisturbed(since_);
  if (!as_told.ok()) rig_.SuspectCamera();  // its last frame is still on its way
  return as_told;
}

absl::Status Bracket::TakeFrame() {
  auto frame = last_->Wait(last_deadline_ + rig_.device_timeout(), "camera: frame");
  last_.reset();
  if (!frame.ok()) {
    rig_.SuspectCamera();
    return frame.status();
  }
  frames_.push_back(*std::move(frame));
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Frame>> Bracket::TakeFrames() {
  RETURN_IF_ERROR(TakeFrame());
  return std::move(frames_);
}

std::vector<ExposureRecord> ExposureRecords(const std::vector<Duration>& requested,
                                            const std::vector<Frame>& frames) {
  std::vector<ExposureRecord> records;
  records.reserve(frames.size());
  for (size_t i = 0; i < frames.size(); ++i) {
    const Frame& f = frames[i];
    records.push_back({.requested = requested[i],
                       .used = f.exposure,
                       .gain_db = f.gain_db,
                       .start = f.exposure_start,
                       .end = f.exposure_end,
                       .device_timestamp_ns = f.device_timestamp_ns,
                       .frame_sequence = f.sequence});
  }
  return records;
}

}  // namespace lightstage
