#include "relight/png.h"

#include <png.h>

#include <cmath>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage::relight {
namespace {

std::vector<uint8_t> Decode(const std::string& bytes, int format, int* width, int* height) {
  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  EXPECT_TRUE(png_image_begin_read_from_memory(&png, bytes.data(), bytes.size())) << png.message;
  png.format = format;
  *width = png.width;
  *height = png.height;
  std::vector<uint8_t> out(PNG_IMAGE_SIZE(png));
  EXPECT_TRUE(png_image_finish_read(&png, nullptr, out.data(), 0, nullptr)) << png.message;
  return out;
}

TEST(EncodePng, IsSrgb) {
  Image image(4, 2, 3);
  // sRGB: linear 0.2140 is code 127.5, 0.5 is 187.5 (188); clipped at both ends.
  const float values[] = {0, 0.25f, 0.107f, 9, -1, NAN};
  for (int i = 0; i < 6; ++i) image.at(i % 4, i / 4, 0) = values[i];
  auto bytes = EncodePng(image, 2);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  int width, height;
  auto codes = Decode(*bytes, PNG_FORMAT_RGB, &width, &height);
  EXPECT_EQ(width, 4);
  EXPECT_EQ(height, 2);
  EXPECT_EQ(codes[0], 0);
  EXPECT_EQ(codes[3], 188);
  EXPECT_NEAR(codes[6], 127.5, 0.5);
  EXPECT_EQ(codes[9], 255);
  EXPECT_EQ(codes[12], 0);
  EXPECT_EQ(codes[15], 0);
  EXPECT_EQ(codes[1], 0);

  Image grey(1, 1, 1, 1.0f);
  codes = Decode(*EncodePng(grey, 1), PNG_FORMAT_GRAY, &width, &height);
  EXPECT_EQ(codes, std::vector<uint8_t>{255});
  EXPECT_EQ(ErrorReason(EncodePng(Image(2, 2, 2), 1).status()), "IMAGE_INVALID");
  EXPECT_EQ(ErrorReason(EncodePng(Image(), 1).status()), "IMAGE_INVALID");
}

TEST(AutoExposure, LooksAtLitPixelsOnly) {
  Image image(100, 100, 3);
  for (int i = 0; i < 100; ++i) image.at(i, 0, 1) = i + 1;
  EXPECT_NEAR(AutoExposure(image, 50), 0.9 / 50, 1e-9);
  EXPECT_NEAR(AutoExposure(image, 100), 0.9 / 100, 1e-9);
  EXPECT_EQ(AutoExposure(Image(3, 3, 1)), 1);
}

}  // namespace
}  // namespace lightstage::relight
