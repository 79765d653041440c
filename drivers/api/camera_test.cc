#include "drivers/api/camera.h"

#include <gtest/gtest.h>

namespace lightstage {
namespace {

struct Row {
  PixelFormat format;
  std::string_view name;
  int bytes, samples;
  bool bayer;
};

// From the GenICam Pixel Format Naming Convention.
constexpr Row kRows[] = {
    {PixelFormat::kMono8, "Mono8", 1, 1, false},
    {PixelFormat::kMono16, "Mono16", 2, 1, false},
    {PixelFormat::kBayerRG8, "BayerRG8", 1, 1, true},
    {PixelFormat::kBayerGR8, "BayerGR8", 1, 1, true},
    {PixelFormat::kBayerGB8, "BayerGB8", 1, 1, true},
    {PixelFormat::kBayerBG8, "BayerBG8", 1, 1, true},
    {PixelFormat::kBayerRG16, "BayerRG16", 2, 1, true},
    {PixelFormat::kBayerGR16, "BayerGR16", 2, 1, true},
    {PixelFormat::kBayerGB16, "BayerGB16", 2, 1, true},
    {PixelFormat::kBayerBG16, "BayerBG16", 2, 1, true},
    {PixelFormat::kRGB8, "RGB8", 1, 3, false},
    {PixelFormat::kRGB16, "RGB16", 2, 3, false},
};

TEST(PixelFormat, TraitsFollowTheNamingConvention) {
  for (const Row& row : kRows) {
    EXPECT_EQ(PixelFormatName(row.format), row.name);
    EXPECT_EQ(BytesPerSample(row.format), row.bytes) << row.name;
    EXPECT_EQ(SamplesPerPixel(row.format), row.samples) << row.name;
    EXPECT_EQ(IsBayer(row.format), row.bayer) << row.name;
  }
}

TEST(PixelFormat, EveryNameParsesBack) {
  for (const Row& row : kRows) {
    absl::StatusOr<PixelFormat> parsed = ParsePixelFormat(row.name);
    ASSERT_TRUE(parsed.ok()) << row.name;
    EXPECT_EQ(*parsed, row.format);
  }
}

TEST(PixelFormat, UnknownNameIsRefusedAndKnownOnesAreListed) {
  for (std::string_view bad : {"", "mono8", "Mono12", "BayerRG8 "}) {
    absl::Status status = ParsePixelFormat(bad).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_EQ(ErrorReason(status), "PIXEL_FORMAT");
    EXPECT_NE(status.message().find("Mono8, Mono16, BayerRG8"), std::string_view::npos);
  }
}

}  // namespace
}  // namespace lightstage
