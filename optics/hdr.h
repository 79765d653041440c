// Merging an exposure bracket into linear values (dissertation §2.5.3).
//
// Unit: with a linear camera, share of full scale per second of exposure:
//   value = (code − black) / (full_scale − black) / exposure time in seconds,
// so that 1 is what just fills the range in one second. With a response table, exp(g(code)) per second: the table's own scale,
// and `black` plays no part, because g already answers for the camera's offset.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "absl/status/status.h"
#include "optics/response.h"

namespace lightstage {

// What the codes of a camera mean. Requires 0 ≤ black ≤ low < high ≤ full_scale.
struct CodeRange {
  double full_scale = 255;  // 2^bits − 1
  double black = 0;         // code without light
  double low = 0;           // codes ≤ low are black: they measure nothing
  double high = 255;        // codes ≥ high are saturated
};

enum SampleMark : uint8_t {
  kSampleMeasured = 0,
  // No exposure measured it and at least one was saturated: the value is the best lower bound.
  kSampleAbove = 1,
  // Black in every exposure: the value is 0.
  kSampleBelow = 2,
};

// One exposure's codes, `bytes_per_sample` each (little-endian), without padding.
struct BracketFrame {
  std::span<const std::byte> samples;
  double seconds = 0;
};

// Merges sample by sample into `values` and `marks`, both as long as a frame has samples.
// Every sample weighs by a hat over its code, exactly 0 at `low` and below and at `high` and above. A linear camera's exposures are
// averaged as they are (a mean of logarithms is biased low where noise matters); a table's in the logarithm, as g is fitted.
// INVALID_ARGUMENT / BRACKET_INVALID: no frame, a frame of another size, a time that is not positive and finite, a bad range, or
// a table that does not cover full_scale + 1 codes. Thread-safe.
absl::Status MergeBracket(std::span<const BracketFrame> frames, int bytes_per_sample,
                          const CodeRange& range, const ResponseCurve& response,
                          std::span<float> values, std::span<uint8_t> marks);

}  // namespace lightstage
