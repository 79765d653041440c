// A pattern as the codes of a screen.
#pragma once

#include <cstdint>
#include <vector>

#include "optics/pattern.h"

namespace lightstage {

// One byte a pixel, top row first: round(255 · value^(1/gamma)), so that a projector whose light is (code / 255) ^ gamma shows the value.
// Dark is 0 and full is 255 at any gamma; there is no dithering. The pattern must be valid.
std::vector<uint8_t> RasterOf(const Pattern& pattern, int width, int height, double gamma);

}  // namespace lightstage
