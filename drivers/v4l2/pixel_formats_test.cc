// Bytes made by hand from the tables of the kernel's "Video for Linux API", section "Image Formats".
#include "drivers/v4l2/pixel_formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "base/status.h"

namespace lightstage {
namespace {

using testing::ElementsAre;

std::vector<std::byte> Bytes(const std::vector<int>& values) {
  std::vector<std::byte> bytes;
  for (int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

const VideoFormat& Format(std::string_view fourcc, PixelFormat format) {
  for (const VideoFormat& f : VideoFormats()) {
    if (f.fourcc == FourCc(fourcc) && f.format == format) return f;
  }
  ADD_FAILURE() << fourcc << " is not known";
  return VideoFormats().front();
}

// Heap memory of just that length, so that a sanitizer sees a byte too many.
absl::StatusOr<std::vector<std::byte>> Read(const VideoFormat& format, int width, int height,
                                            size_t line, const std::vector<int>& raw,
                                            YuvRange range = YuvRange::kLimited) {
  const std::vector<std::byte> bytes = Bytes(raw);
  return Unpack(format, {bytes, width, height, line}, range);
}

std::vector<int> Read8(const VideoFormat& format, int width, int height, size_t line,
                       const std::vector<int>& raw, YuvRange range = YuvRange::kLimited) {
  const auto out = Read(format, width, height, line, raw, range);
  EXPECT_TRUE(out.ok()) << out.status();
  std::vector<int> values;
  if (out.ok()) {
    for (std::byte b : *out) values.push_back(static_cast<int>(b));
  }
  return values;
}

std::vector<int> Read16(const VideoFormat& format, int width, int height, size_t line,
                        const std::vector<int>& raw) {
  const std::vector<int> bytes = Read8(format, width, height, line, raw);
  std::vector<int> values;
  for (size_t i = 0; i + 1 < bytes.size(); i += 2) values.push_back(bytes[i] | bytes[i + 1] << 8);
  return values;
}

TEST(PixelFormats, NamesAreTheKernels) {
  EXPECT_EQ(FourCcName(FourCc("pBAA")), "pBAA");
  EXPECT_EQ(FourCc("Y10"), FourCc("Y10 "));
  EXPECT_EQ(FourCc("Y16 -BE"), FourCc("Y16 ") | 1u << 31);
  EXPECT_EQ(FourCcName(FourCc("Y16 -BE")), "Y16 -BE");
  EXPECT_EQ(FourCcName(0x01020304), "????");
  EXPECT_EQ(FourCc(""), 0u);
  EXPECT_EQ(FourCc("YUYV2"), 0u);
  EXPECT_EQ(FourCc("Y\n10"), 0u);
  EXPECT_TRUE(IsCompressed(FourCc("MJPG")));
  EXPECT_FALSE(IsCompressed(FourCc("YUYV")));
}

TEST(PixelFormats, BayerNamesMeanTheFirstTwoPixels) {
  // SBGGR: the first row begins blue, green.
  for (const auto& [fourcc, format] :
       std::vector<std::pair<const char*, PixelFormat>>{{"BA81", PixelFormat::kBayerBG8},
                                                        {"GBRG", PixelFormat::kBayerGB8},
                                                        {"GRBG", PixelFormat::kBayerGR8},
                                                        {"RGGB", PixelFormat::kBayerRG8},
                                                        {"BG10", PixelFormat::kBayerBG16},
                                                        {"GB10", PixelFormat::kBayerGB16},
                                                        {"BA10", PixelFormat::kBayerGR16},
                                                        {"RG10", PixelFormat::kBayerRG16},
                                                        {"pBAA", PixelFormat::kBayerBG16},
                                                        {"pGAA", PixelFormat::kBayerGB16},
                                                        {"pgAA", PixelFormat::kBayerGR16},
                                                        {"pRAA", PixelFormat::kBayerRG16},
                                                        {"BA12", PixelFormat::kBayerGR16},
                                                        {"pgCC", PixelFormat::kBayerGR16},
                                                        {"GR14", PixelFormat::kBayerGR16},
                                                        {"pBEE", PixelFormat::kBayerBG16},
                                                        {"BYR2", PixelFormat::kBayerBG16}}) {
    EXPECT_EQ(Format(fourcc, format).format, format) << fourcc;
  }
}

TEST(PixelFormats, BytesKeepTheirOrderAndPaddingIsLeftOut) {
  EXPECT_THAT(Read8(Format("GREY", PixelFormat::kMono8), 3, 2, 5,
                    {1, 2, 3, 99, 99, 4, 5, 255}),  // the last row needs no padding
              ElementsAre(1, 2, 3, 4, 5, 255));
}

TEST(PixelFormats, WordsAreLittleEndianInTheLowBits) {
  const VideoFormat& y10 = Format("Y10 ", PixelFormat::kMono16);
  EXPECT_EQ(y10.significant_bits, 10);
  EXPECT_THAT(Read16(y10, 2, 1, 4, {0xff, 0x03, 0x01, 0x02}), ElementsAre(0x3ff, 0x201));
  EXPECT_EQ(Format("Y12 ", PixelFormat::kMono16).significant_bits, 12);
  EXPECT_EQ(Format("Y14 ", PixelFormat::kMono16).significant_bits, 14);
  EXPECT_THAT(Read16(Format("Y16 ", PixelFormat::kMono16), 1, 2, 3, {0x34, 0x12, 9, 0xff, 0xff}),
              ElementsAre(0x1234, 0xffff));
  EXPECT_THAT(Read16(Format("Y16 -BE", PixelFormat::kMono16), 2, 1, 4, {0x12, 0x34, 0, 1}),
              ElementsAre(0x1234, 1));
}

// A camera that shifts its samples up, or fills the upper bits, is not taken for a bright one.
TEST(PixelFormats, SamplesWithTooManyBitsAreRefused) {
  const absl::Status refused =
      Read(Format("Y10 ", PixelFormat::kMono16), 2, 1, 4, {0, 0, 0x40, 0x04}).status();
  EXPECT_EQ(ErrorReason(refused), "SAMPLE_RANGE") << refused;
  EXPECT_NE(refused.message().find("10 bits"), std::string_view::npos) << refused;
  VideoFormat twelve = Format("Y16 ", PixelFormat::kMono16);
  twelve.significant_bits = 12;
  EXPECT_TRUE(Read(twelve, 1, 1, 2, {0xff, 0x0f}).ok());
  EXPECT_FALSE(Read(twelve, 1, 1, 2, {0x00, 0x10}).ok());
}

// "Each of the first 4 bytes contain the 8 high order bits of the pixels, and the 5th byte contains the 2 least significants bits of
// each pixel, in the same order": G03 in bits 7–6, B02 5–4, G01 3–2, B00 1–0.
TEST(PixelFormats, Mipi10) {
  for (const auto& [fourcc, format] : std::vector<std::pair<const char*, PixelFormat>>{
           {"pBAA", PixelFormat::kBayerBG16}, {"Y10P", PixelFormat::kMono16}}) {
    const VideoFormat& f = Format(fourcc, format);
    EXPECT_EQ(f.significant_bits, 10);
    EXPECT_THAT(Read16(f, 4, 1, 5, {0x00, 0x40, 0x80, 0xff, 0b11'10'01'00}),
                ElementsAre(0, 0x101, 0x202, 0x3ff));
    EXPECT_THAT(Read16(f, 4, 1, 5, {0, 0, 0, 0, 0b00'00'00'11}), ElementsAre(3, 0, 0, 0));
  }
  // A width that fills no whole group still has one, and padding follows it.
  EXPECT_THAT(Read16(Format("pBAA", PixelFormat::kBayerBG16), 2, 2, 8,
                     {1, 2, 0, 0, 0b10'01, 7, 7, 7, 3, 4, 0, 0, 0b01'10}),
              ElementsAre(5, 10, 14, 17));
}

// Third byte: G01 in bits 7–4, B00 in bits 3–0.
TEST(PixelFormats, Mipi12) {
  const VideoFormat& f = Format("pBCC", PixelFormat::kBayerBG16);
  EXPECT_EQ(f.significant_bits, 12);
  EXPECT_THAT(Read16(f, 4, 1, 6, {0x12, 0xab, 0xc3, 0xff, 0x00, 0x0f}),
              ElementsAre(0x123, 0xabc, 0xfff, 0x000));
  EXPECT_THAT(Read16(Format("Y12P", PixelFormat::kMono16), 1, 1, 3, {0x80, 0, 0x01}),
              ElementsAre(0x801));
}

// Bytes 4 to 6: "G01low bits 1–0 (bits 7–6), B00low bits 5–0 (bits 5–0)"; "R02low bits 3–0 (bits 7–4), G01low bits 5–2 (bits 3–0)";
// "G03low bits 5–0 (bits 7–2), R02low bits 5–4 (bits 1–0)".
TEST(PixelFormats, Mipi14) {
  const VideoFormat& f = Format("pBEE", PixelFormat::kBayerBG16);
  EXPECT_EQ(f.significant_bits, 14);
  EXPECT_THAT(Read16(f, 4, 1, 7, {0, 0, 0, 0, 0b00'111111, 0, 0}), ElementsAre(63, 0, 0, 0));
  EXPECT_THAT(Read16(f, 4, 1, 7, {0, 0, 0, 0, 0b11'000000, 0b0000'1111, 0}),
              ElementsAre(0, 63, 0, 0));
  EXPECT_THAT(Read16(f, 4, 1, 7, {0, 0, 0, 0, 0, 0b1111'0000, 0b000000'11}),
              ElementsAre(0, 0, 63, 0));
  EXPECT_THAT(Read16(f, 4, 1, 7, {0, 0, 0, 0, 0, 0, 0b111111'00}), ElementsAre(0, 0, 0, 63));
  EXPECT_THAT(Read16(f, 4, 1, 7, {1, 2, 0x80, 0xff, 0b01'000001, 0, 0}),
              ElementsAre(64 + 1, 128 + 1, 0x80 << 6, 0xff << 6));
}

// Y0[9:2]; Y0[1:0] Y1[9:4]; Y1[3:0] Y2[9:6]; Y2[5:0] Y3[9:8]; Y3[7:0].
TEST(PixelFormats, Bits10) {
  const VideoFormat& f = Format("Y10B", PixelFormat::kMono16);
  EXPECT_EQ(f.significant_bits, 10);
  EXPECT_THAT(Read16(f, 4, 1, 5, {0xff, 0b11'000000, 0, 0, 0}), ElementsAre(0x3ff, 0, 0, 0));
  EXPECT_THAT(Read16(f, 4, 1, 5, {0, 0b00'111111, 0b1111'0000, 0, 0}), ElementsAre(0, 0x3ff, 0, 0));
  EXPECT_THAT(Read16(f, 4, 1, 5, {0, 0, 0b0000'1111, 0b111111'00, 0}), ElementsAre(0, 0, 0x3ff, 0));
  EXPECT_THAT(Read16(f, 4, 1, 5, {0, 0, 0, 0b000000'11, 0xff}), ElementsAre(0, 0, 0, 0x3ff));
  EXPECT_THAT(Read16(f, 1, 2, 2, {0x80, 0x40, 0x00, 0x80}), ElementsAre(0x201, 2));
}

TEST(PixelFormats, RgbAndBgr) {
  EXPECT_THAT(Read8(Format("RGB3", PixelFormat::kRGB8), 2, 1, 6, {1, 2, 3, 4, 5, 6}),
              ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(Read8(Format("BGR3", PixelFormat::kRGB8), 2, 1, 6, {3, 2, 1, 6, 5, 4}),
              ElementsAre(1, 2, 3, 4, 5, 6));
}

TEST(PixelFormats, LumaIsTakenAsItIs) {
  EXPECT_TRUE(Format("YUYV", PixelFormat::kMono8).only_by_name);
  EXPECT_THAT(Read8(Format("YUYV", PixelFormat::kMono8), 3, 1, 8, {16, 1, 235, 2, 7, 3, 99, 4}),
              ElementsAre(16, 235, 7));
  EXPECT_THAT(Read8(Format("UYVY", PixelFormat::kMono8), 2, 1, 4, {1, 16, 2, 235}),
              ElementsAre(16, 235));
}

struct Yuv {
  int y, cb, cr;
};

// Forwards, as section "Colorspaces Details" defines it.
Yuv FromRgb(double r, double g, double b, YuvRange range) {
  const double y = 0.299 * r + 0.587 * g + 0.114 * b;
  const double pb = -0.1687 * r - 0.3313 * g + 0.5 * b, pr = 0.5 * r - 0.4187 * g - 0.0813 * b;
  const bool limited = range == YuvRange::kLimited;
  auto rounded = [](double v) { return static_cast<int>(std::lround(v)); };
  return {rounded(limited ? 16 + 219 * y : 255 * y), rounded(128 + (limited ? 224 : 255) * pb),
          rounded(128 + (limited ? 224 : 255) * pr)};
}

TEST(PixelFormats, YuvIsBt601) {
  for (YuvRange range : {YuvRange::kLimited, YuvRange::kFull}) {
    for (int r = 0; r <= 255; r += 51) {
      for (int g = 0; g <= 255; g += 51) {
        for (int b = 0; b <= 255; b += 51) {
          const Yuv c = FromRgb(r / 255.0, g / 255.0, b / 255.0, range);
          auto limit = [](int v) { return std::clamp(v, 0, 255); };
          const std::vector<int> yuyv = Read8(Format("YUYV", PixelFormat::kRGB8), 2, 1, 4,
                                              {c.y, limit(c.cb), c.y, limit(c.cr)}, range);
          const std::vector<int> uyvy = Read8(Format("UYVY", PixelFormat::kRGB8), 2, 1, 4,
                                              {limit(c.cb), c.y, limit(c.cr), c.y}, range);
          ASSERT_EQ(yuyv.size(), 6u);
          EXPECT_EQ(yuyv, uyvy);
          EXPECT_NEAR(yuyv[0], r, 2) << r << " " << g << " " << b;
          EXPECT_NEAR(yuyv[1], g, 2) << r << " " << g << " " << b;
          EXPECT_NEAR(yuyv[2], b, 2) << r << " " << g << " " << b;
          EXPECT_EQ(yuyv[3], yuyv[0]);
        }
      }
    }
  }
  EXPECT_THAT(Read8(Format("YUYV", PixelFormat::kRGB8), 1, 1, 4, {16, 128, 0, 128}),
              ElementsAre(0, 0, 0));
  EXPECT_THAT(Read8(Format("YUYV", PixelFormat::kRGB8), 1, 1, 4, {235, 128, 0, 128}),
              ElementsAre(255, 255, 255));
}

TEST(PixelFormats, AByteTooFewIsAnIncompleteFrame) {
  for (const VideoFormat& format : VideoFormats()) {
    if (format.packing == Packing::kJpeg) continue;  // jpeg_test.cc
    for (int width : {1, 2, 3, 5, 8}) {
      const size_t row = RowBytes(format.packing, width), line = row + 3;
      std::vector<int> raw(line + row, 0);
      EXPECT_TRUE(Read(format, width, 2, line, raw).ok()) << FourCcName(format.fourcc);
      raw.pop_back();
      const absl::Status status = Read(format, width, 2, line, raw).status();
      EXPECT_EQ(ErrorReason(status), "FRAME_INCOMPLETE") << FourCcName(format.fourcc);
      EXPECT_TRUE(absl::IsDataLoss(status));
    }
  }
}

TEST(PixelFormats, LayoutsThatCanNotBeAreRefused) {
  const VideoFormat& f = Format("Y10P", PixelFormat::kMono16);
  for (const auto& [width, height, line] :
       std::vector<std::tuple<int, int, size_t>>{{0, 1, 5},
                                                 {4, 0, 5},
                                                 {-4, 1, 5},
                                                 {4, 1, 4},
                                                 {4, 1, 0},
                                                 {kLargestSide + 1, 1, 1 << 20},
                                                 {4, 2, SIZE_MAX},
                                                 {4, 3, size_t{1} << 31}}) {
    EXPECT_EQ(ErrorReason(Read(f, width, height, line, {1, 2, 3, 4, 5}).status()), "FRAME_LAYOUT")
        << width << "x" << height << ", " << line;
  }
}

}  // namespace
}  // namespace lightstage
