#include "optics/demosaic.h"

#include "gtest/gtest.h"
#include "optics/hdr.h"

namespace lightstage {
namespace {

int ColourAt(int x, int y, BayerPhase phase) {
  bool red_column = (x & 1) == phase.red_x, red_row = (y & 1) == phase.red_y;
  return red_column == red_row ? (red_row ? 0 : 2) : 1;
}

// Bilinear interpolation is exact on planes away from the border, in all four phases.
TEST(DemosaicBilinear, IsExactOnPlanes) {
  const int w = 9, h = 7;
  auto plane = [](int c, int x, int y) { return 10.0f * (c + 1) + (c + 1) * x - 2.0f * c * y; };
  for (BayerPhase phase : {BayerPhase{0, 0}, {1, 0}, {0, 1}, {1, 1}}) {
    std::vector<float> mosaic;
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) mosaic.push_back(plane(ColourAt(x, y, phase), x, y));
    }
    auto out = DemosaicBilinear(mosaic, std::vector<uint8_t>(w * h), w, h, phase);
    for (int y = 1; y < h - 1; ++y) {
      for (int x = 1; x < w - 1; ++x) {
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(out.pixels.at(x, y, c), plane(c, x, y), 1e-4);
      }
    }
  }
}

TEST(DemosaicBilinear, KeepsConstantsAtTheBorder) {
  const int w = 2, h = 5;
  const BayerPhase phase{1, 0};
  std::vector<float> mosaic;
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) mosaic.push_back(1.0f + ColourAt(x, y, phase));
  }
  auto out = DemosaicBilinear(mosaic, std::vector<uint8_t>(w * h), w, h, phase);
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      for (int c = 0; c < 3; ++c) EXPECT_FLOAT_EQ(out.pixels.at(x, y, c), 1.0f + c);
    }
  }
}

TEST(DemosaicBilinear, MarksSpreadToWhatIsMadeOfThem) {
  const int w = 6, h = 6;
  std::vector<uint8_t> marks(w * h);
  marks[2 * w + 2] = kSampleAbove;  // a red sample: feeds its eight neighbours and itself
  auto out = DemosaicBilinear(std::vector<float>(w * h), marks, w, h, {0, 0});
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      bool fed = std::abs(x - 2) <= 1 && std::abs(y - 2) <= 1;
      EXPECT_EQ(out.marks[y * w + x], fed ? kSampleAbove : 0) << x << "," << y;
    }
  }
  std::fill(marks.begin(), marks.end(), uint8_t(kSampleBelow));
  marks[2 * w + 2] = kSampleMeasured;
  out = DemosaicBilinear(std::vector<float>(w * h), marks, w, h, {0, 0});
  EXPECT_EQ(out.marks[0], kSampleBelow);
  EXPECT_EQ(out.marks[2 * w + 3], 0);
  EXPECT_EQ(out.marks[3 * w + 3], 0);
}

}  // namespace
}  // namespace lightstage
