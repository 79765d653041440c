// From a colour mosaic to a full-resolution picture, bilinear. It runs on merged linear values: interpolating codes of single
// exposures would mix saturated with measured samples.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "optics/image.h"

namespace lightstage {

// Where the red sample of each 2×2 tile lies; blue is opposite, green the other two.
struct BayerPhase {
  int red_x = 0, red_y = 0;  // 0 or 1
};

struct DemosaicedImage {
  Image pixels;                // RGB
  std::vector<uint8_t> marks;  // SampleMark (optics/hdr.h), one per pixel
};

// `mosaic` and `marks` have width·height entries, width and height at least 2. Missing colours are means of the nearest samples of
// that colour; the border is mirrored. A pixel is kSampleAbove if any sample it is made of is, kSampleBelow if all are.
DemosaicedImage DemosaicBilinear(std::span<const float> mosaic, std::span<const uint8_t> marks,
                                 int width, int height, BayerPhase phase);

}  // namespace lightstage
