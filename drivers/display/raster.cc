#include "drivers/display/raster.h"

#include <algorithm>
#include <cmath>

namespace lightstage {

std::vector<uint8_t> RasterOf(const Pattern& pattern, int width, int height, double gamma) {
  const Image image = Rasterize(pattern, width, height);
  std::vector<uint8_t> codes(static_cast<size_t>(width) * height);
  uint8_t* code = codes.data();
  for (int y = 0; y < height; ++y) {
    for (float value : image.row(y)) {
      double share = std::clamp(static_cast<double>(value), 0.0, 1.0);
      if (gamma != 1) share = std::pow(share, 1 / gamma);
      *code++ = static_cast<uint8_t>(std::lround(255 * share));
    }
  }
  return codes;
}

}  // namespace lightstage
