#include "drivers/v4l2/capabilities.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

FrameSizes Discrete(std::vector<std::pair<int, int>> sizes) {
  FrameSizes all;
  all.discrete = std::move(sizes);
  return all;
}

V4l2Capabilities Webcam() {
  V4l2Capabilities caps;
  VideoFormat video;
  video.format = PixelFormat::kRGB8;
  caps.formats = {{video, Discrete({{640, 480}, {1920, 1080}, {1280, 720}})}};
  caps.sensor_width = 1920;
  caps.sensor_height = 1080;
  ControlRange exposure;
  exposure.min = 3;
  exposure.max = 2047;
  caps.exposure = {exposure, 100e3};
  return caps;
}

TEST(V4l2Capabilities, SizesAreTakenExactlyAsOffered) {
  const V4l2Capabilities caps = Webcam();
  EXPECT_EQ(caps.Validate({PixelFormat::kRGB8, 1280, 720, 0}).verdict, ConfigVerdict::kValid);
  ConfigResult result = caps.Validate({PixelFormat::kRGB8, 1000, 700, 0});
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(result.config.width, 1280);
  EXPECT_EQ(result.config.height, 720);
  EXPECT_NE(result.notes.at(0).find("640x480, 1920x1080, 1280x720"), std::string::npos)
      << result.notes[0];
  result = caps.Validate({PixelFormat::kRGB8, 5000, 700, 0});
  EXPECT_EQ(result.config.width, 1920);
  EXPECT_EQ(caps.Validate({PixelFormat::kRGB8, 0, 700, 0}).verdict, ConfigVerdict::kInvalid);
  EXPECT_EQ(caps.Validate({PixelFormat::kMono8, 640, 480, 0}).verdict, ConfigVerdict::kInvalid);
}

TEST(V4l2Capabilities, RangesOfSizesHaveSteps) {
  V4l2Capabilities caps = Webcam();
  caps.formats[0].sizes = {};
  caps.formats[0].sizes.width = {16, 800, 8};
  caps.formats[0].sizes.height = {16, 600, 2};
  const ConfigResult result = caps.Validate({PixelFormat::kRGB8, 100, 601, 0});
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(result.config.width, 96);
  EXPECT_EQ(result.config.height, 600);
}

TEST(V4l2Capabilities, RegionsAreCutInSteps) {
  V4l2Capabilities caps = Webcam();
  caps.crop_step = 4;
  caps.sensor_width = 1922;
  caps.sensor_height = 1080;
  EXPECT_EQ(caps.Validate({PixelFormat::kRGB8, 1922, 1080, 0}).verdict, ConfigVerdict::kValid);
  EXPECT_EQ(caps.Validate({PixelFormat::kRGB8, 100, 100, 0}).verdict, ConfigVerdict::kValid);
  const ConfigResult result = caps.Validate({PixelFormat::kRGB8, 1921, 101, 0});
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(result.config.width, 1920);
  EXPECT_EQ(result.config.height, 100);
  EXPECT_EQ(CentredOffset(1922, 100, 4), 908);
}

TEST(V4l2Capabilities, ExposuresComeInSteps) {
  const V4l2Capabilities caps = Webcam();
  EXPECT_EQ(caps.MinExposure(), microseconds(300));
  EXPECT_EQ(caps.MaxExposure(), microseconds(204700));
  const ExposureResult result = caps.ValidateExposure(microseconds(1260), Duration::zero());
  EXPECT_EQ(result.verdict, ConfigVerdict::kValid);
  EXPECT_EQ(result.exposure, microseconds(1300));
  EXPECT_EQ(caps.ExposureCode(microseconds(1260)), 13);
  EXPECT_EQ(caps.ValidateExposure(microseconds(200), {}).exposure, microseconds(300));
  EXPECT_EQ(caps.ValidateExposure(microseconds(200), {}).verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(caps.ValidateExposure(Duration::min(), {}).verdict, ConfigVerdict::kInvalid);
}

// A free-running camera cuts an exposure off when the next frame begins, whatever its control says.
TEST(V4l2Capabilities, NoExposureIsLongerThanAFrame) {
  V4l2Capabilities caps = Webcam();
  const ExposureResult result = caps.ValidateExposure(milliseconds(50), milliseconds(33));
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(result.exposure, milliseconds(33));
  EXPECT_NE(result.note.find("time of a frame"), std::string::npos) << result.note;
  EXPECT_EQ(caps.ValidateExposure(milliseconds(33), microseconds(33333)).exposure,
            milliseconds(33));
  EXPECT_EQ(caps.ValidateExposure(microseconds(33280), microseconds(33333)).exposure,
            microseconds(33300));
  caps.frame_limit = milliseconds(20);
  EXPECT_EQ(caps.MaxExposure(), milliseconds(20));
  EXPECT_EQ(caps.ValidateExposure(caps.MaxExposure(), {}).verdict, ConfigVerdict::kValid);
}

TEST(V4l2Capabilities, LinesHaveTheirOwnLength) {
  V4l2Capabilities caps = Webcam();
  caps.exposure->unit_ns = 29630.5;
  caps.exposure->control.min = 0;
  caps.exposure->control.step = 2;
  EXPECT_EQ(caps.MinExposure(), Duration(59261));  // zero lines are no exposure
  EXPECT_EQ(caps.ExposureOf(1000), Duration(29630500));
  EXPECT_EQ(caps.ExposureCode(Duration(29630500)), 1000);
  EXPECT_EQ(caps.ExposureCode(Duration(29630500 + 29630)), 1002);
  for (Duration end : {caps.MinExposure(), caps.MaxExposure()}) {
    EXPECT_EQ(caps.ValidateExposure(end, {}).verdict, ConfigVerdict::kValid);
    EXPECT_EQ(caps.ValidateExposure(end, {}).exposure, end);
  }
}

TEST(V4l2Capabilities, AFixedExposureIsTheOnlyOne) {
  V4l2Capabilities caps = Webcam();
  caps.exposure.reset();
  caps.fixed_exposure = milliseconds(10);
  EXPECT_EQ(caps.ValidateExposure(milliseconds(10), milliseconds(5)).verdict,
            ConfigVerdict::kValid);
  const ExposureResult result = caps.ValidateExposure(milliseconds(11), {});
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(result.exposure, milliseconds(10));
  EXPECT_NE(result.note.find("fixed_exposure_us"), std::string::npos);
  EXPECT_EQ(caps.MaxExposure(), caps.MinExposure());
}

TEST(V4l2Capabilities, GainInDecibelsOnlyIfItsStepIsKnown) {
  V4l2Capabilities caps = Webcam();
  ControlRange gain;
  gain.min = 16;
  gain.max = 96;
  caps.gain = gain;
  EXPECT_EQ(caps.MaxGainDb(), 0);
  EXPECT_EQ(caps.GainCode(0), 16);
  EXPECT_EQ(caps.Validate({PixelFormat::kRGB8, 640, 480, 6}).verdict, ConfigVerdict::kAdjusted);
  caps.gain_db_per_step = 0.3;
  EXPECT_DOUBLE_EQ(caps.MaxGainDb(), 24);
  EXPECT_EQ(caps.GainCode(6), 36);
  EXPECT_EQ(caps.Validate({PixelFormat::kRGB8, 640, 480, 6}).verdict, ConfigVerdict::kValid);
  const ConfigResult result = caps.Validate({PixelFormat::kRGB8, 640, 480, 6.1});
  EXPECT_EQ(result.verdict, ConfigVerdict::kAdjusted);
  EXPECT_NEAR(result.config.gain_db, 6, 1e-9);
  EXPECT_EQ(caps.Validate({PixelFormat::kRGB8, 640, 480, std::nan("")}).verdict,
            ConfigVerdict::kInvalid);
}

TEST(V4l2Capabilities, TheBestFormatIsChosen) {
  const FrameSizes sizes = Discrete({{640, 480}});
  const std::vector<VideoDescription::Format> offered = {
      {FourCc("MJPG"), sizes}, {FourCc("YUYV"), sizes}, {FourCc("Y10P"), sizes},
      {FourCc("Y12 "), sizes}, {FourCc("pBAA"), {}},    {FourCc("BGR3"), sizes}};
  auto formats = UsableFormats(offered, {});
  ASSERT_EQ(formats.size(), 2u);  // a format without a size can not be had
  EXPECT_EQ(formats[0].video.fourcc, FourCc("Y12 "));
  EXPECT_EQ(formats[1].video.fourcc, FourCc("BGR3"));
  V4l2Options options;
  options.fourcc = FourCc("YUYV");
  formats = UsableFormats(offered, options);
  ASSERT_EQ(formats.size(), 2u);
  EXPECT_EQ(formats[0].video.format, PixelFormat::kMono8);  // luma, as it was named
  EXPECT_EQ(formats[1].video.format, PixelFormat::kRGB8);
  // What is lossy is never the best, also where there is nothing else.
  EXPECT_TRUE(UsableFormats({{FourCc("MJPG"), sizes}}, {}).empty());
  options.fourcc = FourCc("MJPG");
  formats = UsableFormats(offered, options);
  ASSERT_EQ(formats.size(), 2u);
  EXPECT_EQ(formats[0].video.format, PixelFormat::kMono8);
  EXPECT_EQ(formats[1].video.format, PixelFormat::kRGB8);
  options.fourcc = FourCc("Y16 ");
  options.significant_bits = 12;
  formats = UsableFormats({{FourCc("Y16 "), sizes}}, options);
  ASSERT_EQ(formats.size(), 1u);
  EXPECT_EQ(formats[0].video.significant_bits, 12);
}

TEST(ControlRange, FitsToItsSteps) {
  ControlRange control;
  control.min = -10;
  control.max = 21;
  control.step = 4;
  EXPECT_EQ(control.Fit(-100), -10);
  EXPECT_EQ(control.Fit(-7), -6);
  EXPECT_EQ(control.Fit(100), 18);
}

}  // namespace
}  // namespace lightstage
