#include "drivers/aravis/pixel_formats.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace lightstage {
namespace {

std::vector<std::byte> Bytes(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

std::vector<int> Samples(std::string_view name, const std::vector<std::byte>& bytes, int width,
                         int height = 1, size_t padding = 0) {
  const GenicamFormat& format = *FindGenicamFormat(name);
  std::vector<std::byte> out =
      UnpackGenicam(format, bytes, width, height, GenicamRowBytes(format, width) + padding);
  std::vector<int> samples;
  for (size_t i = 0; i + 1 < out.size(); i += 2) {
    samples.push_back(static_cast<int>(out[i]) | static_cast<int>(out[i + 1]) << 8);
  }
  return samples;
}

// PFNC, Mono12p: B0 = P0[7:0], B1 = P1[3:0] P0[11:8], B2 = P1[11:4].
TEST(UnpackGenicam, TwelveBitsLowestFirst) {
  EXPECT_EQ(Samples("Mono12p", Bytes({0xBC, 0x3A, 0x12}), 2), (std::vector{0xABC, 0x123}));
  EXPECT_EQ(Samples("BayerRG12p", Bytes({0xFF, 0x0F, 0x00, 0x00, 0xF0, 0xFF}), 4),
            (std::vector{0xFFF, 0, 0, 0xFFF}));
}

// PFNC, Mono10p: B0 = P0[7:0], B1 = P1[5:0] P0[9:8], B2 = P2[3:0] P1[9:6], B3 = P3[1:0] P2[9:4], B4 = P3[9:2].
TEST(UnpackGenicam, TenBitsLowestFirst) {
  EXPECT_EQ(Samples("Mono10p", Bytes({0x01, 0x08, 0x30, 0x00, 0x01}), 4),
            (std::vector{1, 2, 3, 4}));
  EXPECT_EQ(Samples("BayerBG10p", Bytes({0xFF, 0x03, 0x00, 0xC0, 0xFF}), 4),
            (std::vector{0x3FF, 0, 0, 0x3FF}));
}

// GigE Vision, Mono12Packed: B0 = P0[11:4], B1 = P1[3:0] P0[3:0], B2 = P1[11:4].
TEST(UnpackGenicam, TwelveBitsGigE) {
  EXPECT_EQ(Samples("Mono12Packed", Bytes({0xAB, 0x3C, 0x12}), 2), (std::vector{0xABC, 0x123}));
  EXPECT_EQ(Samples("BayerGB12Packed", Bytes({0xFF, 0x0F, 0x00, 0x00, 0xF0, 0xFF}), 4),
            (std::vector{0xFFF, 0, 0, 0xFFF}));
}

// GigE Vision, Mono10Packed: B0 = P0[9:2], B1 = xx P1[1:0] xx P0[1:0], B2 = P1[9:2].
TEST(UnpackGenicam, TenBitsGigE) {
  EXPECT_EQ(Samples("Mono10Packed", Bytes({0xAB, 0x12, 0x55}), 2), (std::vector{0x2AE, 0x155}));
  EXPECT_EQ(Samples("Mono10Packed", Bytes({0xAB, 0xDE, 0x55}), 2), (std::vector{0x2AE, 0x155}))
      << "bits of no pixel count for nothing";
}

TEST(UnpackGenicam, PaddingIsNoPartOfTheImage) {
  EXPECT_EQ(Samples("Mono12p", Bytes({0xBC, 0x3A, 0x12, 0xEE, 0xEE, 0x01, 0x20, 0x00}), 2, 2, 2),
            (std::vector{0xABC, 0x123, 0x001, 0x002}));
  EXPECT_EQ(Samples("Mono12", Bytes({0xBC, 0x0A, 0xEE, 0x23, 0x01}), 1, 2, 1),
            (std::vector{0xABC, 0x123}));
}

TEST(UnpackGenicam, TooFewBytesAreNoImage) {
  EXPECT_TRUE(Samples("Mono12p", Bytes({0xBC, 0x3A}), 2).empty());
  EXPECT_TRUE(Samples("Mono12", Bytes({0xBC, 0x3A, 0x12}), 2).empty());
}

TEST(GenicamFormats, AreWhatTheirNamesAndCodesSay) {
  std::set<uint32_t> codes;
  for (const GenicamFormat& format : GenicamFormats()) {
    EXPECT_TRUE(codes.insert(format.code).second) << format.name;
    EXPECT_EQ(FindGenicamFormat(format.name), &format);
    EXPECT_NE(format.name.find(std::to_string(format.significant_bits)), std::string_view::npos)
        << format.name;
    const int pixel_bits = static_cast<int>(format.code >> 16 & 0xff);
    const int samples = SamplesPerPixel(format.format);
    switch (format.packing) {
      case GenicamPacking::kNone:
        EXPECT_EQ(pixel_bits, samples * 8 * BytesPerSample(format.format)) << format.name;
        break;
      case GenicamPacking::kLsbFirst:
        EXPECT_TRUE(format.name.ends_with("p"));
        EXPECT_EQ(pixel_bits, format.significant_bits) << format.name;
        break;
      case GenicamPacking::kGigE:
        EXPECT_TRUE(format.name.ends_with("Packed"));
        EXPECT_EQ(pixel_bits, 12) << format.name;
        break;
    }
    EXPECT_EQ(PixelsPerGroup(format) * pixel_bits % 8, 0) << format.name;
  }
  EXPECT_EQ(FindGenicamFormat("Mono13"), nullptr);
}

}  // namespace
}  // namespace lightstage
