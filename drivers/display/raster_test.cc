#include "drivers/display/raster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace lightstage {
namespace {

Pattern Hat() {
  Pattern pattern;
  pattern.arrangement = PatternArrangement::kSquare;
  pattern.profile = PatternProfile::kHat;
  pattern.grid = 4;
  pattern.column = 1;
  pattern.row = 2;
  return pattern;
}

TEST(RasterOf, RoundsEachPixelsValue) {
  const Image image = Rasterize(Hat(), 40, 24);
  const std::vector<uint8_t> codes = RasterOf(Hat(), 40, 24, 1);
  ASSERT_EQ(codes.size(), 40u * 24u);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 40; ++x) {
      EXPECT_NEAR(codes[y * 40 + x], 255.0 * image.row(y)[x], 0.5 + 1e-4) << x << "," << y;
    }
  }
}

TEST(RasterOf, TopRowComesFirst) {
  Pattern top = Hat();
  top.profile = PatternProfile::kBox;
  top.column = top.row = 0;
  const std::vector<uint8_t> codes = RasterOf(top, 40, 24, 1);
  EXPECT_EQ(codes.front(), 255);
  EXPECT_EQ(codes[39], 0);
  EXPECT_EQ(codes.back(), 0);
}

TEST(RasterOf, GammaUndoesTheProjectors) {
  const Image image = Rasterize(Hat(), 40, 24);
  const std::vector<uint8_t> codes = RasterOf(Hat(), 40, 24, 2.2);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 40; ++x) {
      const double light = std::pow(codes[y * 40 + x] / 255.0, 2.2);
      EXPECT_NEAR(light, image.row(y)[x], 2.2 * 0.5 / 255 + 1e-4) << x << "," << y;
    }
  }
  Pattern full;
  full.arrangement = PatternArrangement::kFull;
  for (uint8_t code : RasterOf(full, 8, 8, 2.2)) EXPECT_EQ(code, 255);
  for (uint8_t code : RasterOf(Pattern{}, 8, 8, 2.2)) EXPECT_EQ(code, 0);
}

}  // namespace
}  // namespace lightstage
