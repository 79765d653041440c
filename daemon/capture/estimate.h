// What a plan will cost, before any device is touched.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/capture/check_plan.h"
#include "daemon/capture/rig_facts.h"

namespace lightstage {

struct Estimate {
  int64_t shots = 0;        // basis images
  int64_t extra_shots = 0;  // dark and reference frames
  int64_t exposures = 0;    // of all of them
  int64_t positions = 0;    // poses taken one after another
  // The physical bound: what a run takes whose computing, writing and talking to devices cost
  // nothing.
  double duration_seconds = 0;
  int64_t bytes = 0;  // on disk
  std::vector<std::string> notes;
};

// ResolvePlan(), then every shot of the program checked against the limits and added up. Time
// model: the rig starts dark, homed at 0° (or the nearest angle it can reach); a shot takes its
// exposures with a readout after each; from the end of the last exposure on readout, the next move
// (both axes at once) and the next light go in parallel, and the next exposure waits for the
// slowest. Takes about 0.3 µs per shot.
absl::StatusOr<Estimate> EstimatePlan(const Plan& plan, const RigFacts& facts);

// Bytes of one stored basis image, and of its journal and manifest entries. Compressed sizes are
// those of photographs and renderings with sensor noise, measured; what has no noise is smaller.
int64_t EstimatedImageBytes(const CameraConfig& config, const std::string& compression);

}  // namespace lightstage
