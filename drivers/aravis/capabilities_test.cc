#include "drivers/aravis/capabilities.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::nanoseconds;

AravisCapabilities Camera() {
  AravisCapabilities caps;
  caps.formats = UsableFormats({0x01080001, 0x01100005});  // Mono8, Mono12
  caps.width = {16, 1920, 16, 4, true};
  caps.height = {2, 1200, 2, 2, true};
  caps.min_exposure = microseconds(20);
  caps.max_exposure = std::chrono::seconds(10);
  caps.gain = AravisCapabilities::Gain::kDecibels;
  caps.min_gain = 0;
  caps.max_gain = 24;
  return caps;
}

TEST(UsableFormats, DeepestFormatServes16Bit) {
  auto formats = UsableFormats({0x01100003, 0x01100005, 0x010c0006, 0x01080009});
  ASSERT_EQ(formats.size(), 2u);
  EXPECT_EQ(formats[0].format, PixelFormat::kMono16);
  EXPECT_EQ(formats[0].name, "Mono12");  // before Mono10 and Mono12Packed
  EXPECT_EQ(formats[0].significant_bits, 12);
  EXPECT_EQ(formats[1].format, PixelFormat::kBayerRG8);
  formats = UsableFormats({0x010c0006, 0x01100003});
  ASSERT_EQ(formats.size(), 1u);
  EXPECT_EQ(formats[0].name, "Mono12Packed") << "before Mono10";
  EXPECT_TRUE(UsableFormats({0x01080002}).empty()) << "Mono8s";
}

TEST(UsableFormats, TheNamedOneAlone) {
  auto formats = UsableFormats({0x01100005, 0x010c0047, 0x01080001}, "Mono12p");
  ASSERT_EQ(formats.size(), 1u);
  EXPECT_EQ(formats[0].code, 0x010c0047u);
  EXPECT_TRUE(UsableFormats({0x01100005}, "Mono12p").empty());
}

TEST(CentredOffset, IsCentredToItsStep) {
  EXPECT_EQ(CentredOffset(1920, 1920, 4), 0);
  EXPECT_EQ(CentredOffset(1920, 960, 4), 480);
  EXPECT_EQ(CentredOffset(1920, 950, 4), 484);  // 485 rounded down
}

TEST(Validate, WhatTheCameraCanDoIsValid) {
  ConfigResult result = Camera().Validate({PixelFormat::kMono16, 1920, 1200, 6});
  EXPECT_EQ(result.verdict, ConfigVerdict::kValid);
  EXPECT_TRUE(result.notes.empty());
}

TEST(Validate, SizesAreRoundedDownToTheStepAndSaid) {
  ConfigResult result = Camera().Validate({PixelFormat::kMono8, 1001, 3000, 0});
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(result.config.width, 992);
  EXPECT_EQ(result.config.height, 1200);
  ASSERT_EQ(result.notes.size(), 2u);
  EXPECT_EQ(result.notes[0], "width: 1001 asked, 992 possible (16 to 1920 in steps of 16)");
}

// A row of a packed format ends with a byte.
TEST(Validate, PackedRowsAreWholeGroups) {
  AravisCapabilities caps = Camera();
  caps.width = {1, 63, 1, 1, true};
  caps.formats = UsableFormats({0x010c0047}, "Mono12p");
  EXPECT_EQ(caps.Validate({PixelFormat::kMono16, 62, 64, 0}).verdict, ConfigVerdict::kValid);
  ConfigResult result = caps.Validate({PixelFormat::kMono16, 63, 64, 0});
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  ASSERT_EQ(result.notes.size(), 1u);
  EXPECT_EQ(result.notes[0], "width: 63 asked, 62 possible (2 to 63 in steps of 2)");
  caps.formats = UsableFormats({0x010a0046}, "Mono10p");
  EXPECT_EQ(caps.Validate({PixelFormat::kMono16, 63, 64, 0}).config.width, 60);
}

TEST(Validate, MissingFormatNamesWhatThereIs) {
  ConfigResult result = Camera().Validate({PixelFormat::kBayerRG8, 64, 64, 0});
  EXPECT_EQ(result.verdict, ConfigVerdict::kInvalid);
  EXPECT_EQ(result.notes[0], "format: BayerRG8 is not offered; the camera has Mono8, Mono16");
}

TEST(Validate, NanGainIsInvalid) {
  ConfigResult result = Camera().Validate({PixelFormat::kMono8, 64, 64, std::nan("")});
  EXPECT_EQ(result.verdict, ConfigVerdict::kInvalid);
}

TEST(Validate, RawGainNeedsItsUnit) {
  AravisCapabilities caps = Camera();
  caps.gain = AravisCapabilities::Gain::kRaw;
  caps.min_gain = 4;
  caps.max_gain = 14;
  EXPECT_EQ(caps.MaxGainDb(), 0);
  EXPECT_EQ(caps.Validate({PixelFormat::kMono8, 64, 64, 1}).config.gain_db, 0);
  caps.gain_db_per_step = 0.5;
  EXPECT_EQ(caps.MinGainDb(), 0);
  EXPECT_EQ(caps.MaxGainDb(), 5);
  EXPECT_EQ(caps.Validate({PixelFormat::kMono8, 64, 64, 1.5}).verdict, ConfigVerdict::kValid);
  ConfigResult result = caps.Validate({PixelFormat::kMono8, 64, 64, 1.7});
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  EXPECT_DOUBLE_EQ(result.config.gain_db, 1.5);
}

TEST(SameExposure, DiffersByAStepAtMost) {
  AravisCapabilities caps = Camera();
  EXPECT_TRUE(caps.SameExposure(microseconds(500), nanoseconds(499100)));
  EXPECT_FALSE(caps.SameExposure(microseconds(500), nanoseconds(498900)));
  caps.exposure_step = microseconds(20);
  EXPECT_TRUE(caps.SameExposure(microseconds(500), microseconds(520)));
  EXPECT_FALSE(caps.SameExposure(microseconds(500), microseconds(521)));
  EXPECT_FALSE(caps.SameExposure(microseconds(500), microseconds(0)));
}

TEST(ValidateExposure, RangeAndStep) {
  AravisCapabilities caps = Camera();
  EXPECT_EQ(caps.ValidateExposure(microseconds(20)).verdict, ConfigVerdict::kValid);
  ExposureResult low = caps.ValidateExposure(nanoseconds(1));
  EXPECT_EQ(low.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(low.exposure, microseconds(20));
  EXPECT_EQ(low.note, "exposure: 0.001 us asked, 20 us possible (20 to 1e+07 us)");
  EXPECT_EQ(caps.ValidateExposure(Duration::zero()).verdict, ConfigVerdict::kInvalid);
  caps.exposure_step = microseconds(5);
  EXPECT_EQ(caps.ValidateExposure(microseconds(33)).exposure, microseconds(35));
  EXPECT_EQ(caps.ValidateExposure(microseconds(32)).exposure, microseconds(30));
}

}  // namespace
}  // namespace lightstage
