// Measures the latency of a camera that runs freely, the v4l2 driver's latency_ms, with the rig's own light.
//
// The light goes off at a known moment, over and over, at any phase of the camera's frames. A frame that shows light began before that, one that
// is dark did not; how old a frame would be if the camera's latency were 0 is what its driver says (Frame::latest_start). So a dark frame is
// proof that the latency is at most the time from the command to the frame's latest start, and the least such time above that of every frame
// with light is what is looked for.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "daemon/rig/rig.h"

namespace lightstage {

struct LatencyReport {
  std::string light;  // what was switched: "lamps" or "projector"
  std::vector<Duration> exposures;
  int switches = 0;
  // Of the exposure that needs more: the oldest frame with light, and the youngest above it without, with what light may have escaped it.
  Duration with_light{}, without_light{};
  // A quarter of a frame, for what so few frames do not show: a latency that is not always the same.
  Duration margin{};
  // The longest time from a command to its confirmation. When in it the light went off can not be told from the latency, which is that much
  // shorter at most.
  Duration light_time{};

  Duration latency() const { return std::max(without_light + margin, Duration::zero()); }
};

// With the shortest and the longest exposure of the rig file: cameras are not always exposed as long as they say. Leaves the rig dark.
// FAILED_PRECONDITION: LATENCY_NO_LIGHT without lamps and projector, LATENCY_NOT_NEEDED if the camera does not run freely, LIGHT_NOT_SEEN;
// ABORTED / LATENCY_UNCLEAR if frames come too irregularly; CANCELLED soon after `interrupted` says so, unless a device that does not answer is waited for.
absl::StatusOr<LatencyReport> MeasureLatency(Rig& rig, absl::FunctionRef<bool()> interrupted);

// The lines for the table [camera.options], and as comments how they were found.
std::string LatencyToml(const LatencyReport& report);

}  // namespace lightstage
