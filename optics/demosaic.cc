#include "optics/demosaic.h"

#include "optics/hdr.h"

namespace lightstage {
namespace {

// Mirrored about the outermost sample, which keeps the colour: −1 → 1, n → n−2.
int Mirror(int i, int n) { return i < 0 ? -i : i >= n ? 2 * n - 2 - i : i; }

template <class T>
struct Rows {
  Rows(std::span<const T> plane, int width, int height, int y)
      : up(plane.data() + size_t(Mirror(y - 1, height)) * width),
        mid(plane.data() + size_t(y) * width),
        down(plane.data() + size_t(Mirror(y + 1, height)) * width) {}
  const T *up, *mid, *down;
};

}  // namespace

DemosaicedImage DemosaicBilinear(std::span<const float> mosaic, std::span<const uint8_t> marks,
                                 int width, int height, BayerPhase phase) {
  DemosaicedImage out{Image(width, height, 3), std::vector<uint8_t>(size_t(width) * height)};
  for (int y = 0; y < height; ++y) {
    const Rows<float> v(mosaic, width, height, y);
    const Rows<uint8_t> m(marks, width, height, y);
    const bool red_row = (y & 1) == phase.red_y;
    float* rgb = out.pixels.row(y).data();
    uint8_t* mark = out.marks.data() + size_t(y) * width;
    for (int x = 0; x < width; ++x, rgb += 3) {
      const int l = Mirror(x - 1, width), r = Mirror(x + 1, width);
      const bool red_column = (x & 1) == phase.red_x;
      const float own = v.mid[x];
      const float sides = v.mid[l] + v.mid[r];
      const float ends = v.up[x] + v.down[x];
      uint8_t any = m.mid[x] | m.mid[l] | m.mid[r] | m.up[x] | m.down[x];
      uint8_t all = m.mid[x] & m.mid[l] & m.mid[r] & m.up[x] & m.down[x];
      if (red_row != red_column) {  // a green sample: red and blue beside it and above it
        rgb[0] = 0.5f * (red_row ? sides : ends);
        rgb[1] = own;
        rgb[2] = 0.5f * (red_row ? ends : sides);
      } else {
        const float corners = 0.25f * (v.up[l] + v.up[r] + v.down[l] + v.down[r]);
        rgb[0] = red_row ? own : corners;
        rgb[1] = 0.25f * (sides + ends);
        rgb[2] = red_row ? corners : own;
        any |= m.up[l] | m.up[r] | m.down[l] | m.down[r];
        all &= m.up[l] & m.up[r] & m.down[l] & m.down[r];
      }
      mark[x] = (any & kSampleAbove) | (all & kSampleBelow);
    }
  }
  return out;
}

}  // namespace lightstage
