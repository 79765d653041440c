// One exposure bracket, in two halves: when the last exposure has ended light and pose are free, when the last frame is here the
// camera is.
#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/rig/rig.h"

namespace lightstage {

class Bracket {
 public:
  // The rig's camera must be armed. `since`: rig.disturbances() before the light and pose to be exposed were commanded.
  Bracket(Rig& rig, std::vector<Duration> exposures, uint64_t since);

  // Takes all exposures; returns when the last one has ended. RIG_STOPPED or RIG_DISTURBED if light or pose were taken away before
  // that: the picture is not of what it was meant to be.
  absl::Status Expose();
  // Waits for the last frame. One frame per exposure. Call once, after Expose() returned OK.
  absl::StatusOr<std::vector<Frame>> TakeFrames();

 private:
  absl::Status TakeFrame();

  Rig& rig_;
  std::vector<Duration> exposures_;
  const uint64_t since_;
  std::vector<Frame> frames_;
  std::optional<Pending<Frame>> last_;
  TimePoint last_deadline_{};
};

// What the record says about the frames of a bracket.
std::vector<ExposureRecord> ExposureRecords(const std::vector<Duration>& requested,
                                            const std::vector<Frame>& frames);

}  // namespace lightstage
