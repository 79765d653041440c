// Linear pictures for people to look at: one exposure, the sRGB curve, 8 bits.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "base/env.h"
#include "optics/image.h"

namespace lightstage::relight {

// The factor that brings the `percentile` (of the lit pixels' greatest channel) to 0.9. 1 if nothing is lit. Pixels that are black are not
// counted: much of a picture may be backdrop.
double AutoExposure(const Image& linear, double percentile = 99);

// An 8-bit sRGB PNG (grey or RGB) of exposure · linear, clipped to [0,1]. INVALID_ARGUMENT / IMAGE_INVALID if it has other than 1 or 3
// channels or is empty.
absl::StatusOr<std::string> EncodePng(const Image& linear, double exposure);
absl::Status WritePng(const std::string& path, const Image& linear, double exposure,
                      Env& env = PosixEnv());

}  // namespace lightstage::relight
