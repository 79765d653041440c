// A basis image: linear radiance-proportional pixels (camera units per second of exposure; one scale for the whole run), with
// what could not be measured marked per pixel.
#pragma once

#include <cstdint>
#include <vector>

#include "optics/image.h"

namespace lightstage {

// Per-pixel marks, or-ed.
enum PixelFlag : uint8_t {
  kAboveRange =
      1,  // in some channel no exposure measured it and at least one saturated: a lower bound
  kBelowRange = 2,  // black in every exposure, in every channel: the value is 0, which is valid
};

struct BasisImage {
  Image pixels;                // 1 (grey) or 3 (RGB) channels
  std::vector<uint8_t> flags;  // one per pixel, rows like `pixels`
};

}  // namespace lightstage
