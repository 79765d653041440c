#include "drivers/v4l2/options.h"

#include <gtest/gtest.h>

#include "drivers/v4l2/pixel_formats.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

absl::Status Parse(const std::string& text, V4l2Options* options) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse("[camera]\n" + text, "rig.toml");
  if (!document.ok()) return document.status();
  *options = ParseV4l2Options(document->root().Table("camera"));
  return document->Finish();
}

TEST(V4l2Options, EveryKeyIsRead) {
  V4l2Options options;
  const absl::Status status = Parse(
      "device = \"/dev/video2\"\ncard = \"HD Webcam\"\nbus_info = \"usb-1\"\nfourcc = \"Y16\"\n"
      "significant_bits = 12\nframes_per_s = 15\nbuffers = 6\nexposure_unit_us = 29.63\n"
      "gain_db_per_step = 0.3\nleave_automatic = { focus = true, power_line = true, gain = false }"
      "\nlatency_ms = 12.5\nstamps_at_exposure_start = true\ncontrol_delay_frames = 3\n"
      "readout_ms = 8\n",
      &options);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(options.device, "/dev/video2");
  EXPECT_EQ(options.card, "HD Webcam");
  EXPECT_EQ(options.bus_info, "usb-1");
  EXPECT_EQ(options.fourcc, FourCc("Y16 "));
  EXPECT_EQ(options.significant_bits, 12);
  EXPECT_EQ(options.frames_per_s, 15);
  EXPECT_EQ(options.buffers, 6);
  EXPECT_EQ(options.exposure_unit_us, 29.63);
  EXPECT_EQ(options.gain_db_per_step, 0.3);
  EXPECT_EQ(options.leave_automatic, (std::set<std::string>{"focus", "power_line"}));
  EXPECT_EQ(options.latency, microseconds(12500));
  EXPECT_TRUE(options.stamps_at_exposure_start);
  EXPECT_EQ(options.control_delay_frames, 3);
  EXPECT_EQ(options.readout, milliseconds(8));
  ASSERT_TRUE(Parse("device = \"/dev/video0\"\nfixed_exposure_us = 10000\n", &options).ok());
  EXPECT_EQ(options.fixed_exposure, milliseconds(10));
}

TEST(V4l2Options, DefaultsAreTheSafeOnes) {
  V4l2Options options;
  ASSERT_TRUE(Parse("card = \"HD Webcam\"\n", &options).ok());
  EXPECT_FALSE(options.latency.has_value());
  EXPECT_FALSE(options.stamps_at_exposure_start);
  EXPECT_TRUE(options.leave_automatic.empty());
  EXPECT_EQ(options.fourcc, 0u);
  EXPECT_EQ(options.control_delay_frames, 2);
}

TEST(V4l2Options, BadValuesAreRefusedAtTheirKey) {
  V4l2Options options;
  EXPECT_FALSE(Parse("buffers = 4\n", &options).ok());  // any camera
  for (const auto& [bad, word] : std::vector<std::pair<const char*, const char*>>{
           {"buffers = 1", "buffers"},
           {"frames_per_s = 0", "frames_per_s"},
           {"latency_ms = -1", "latency_ms"},
           {"exposure_unit_us = nan", "exposure_unit_us"},
           {"fixed_exposure_us = 0", "fixed_exposure_us"},
           {"fixed_exposure_us = 10\nexposure_unit_us = 10", "fixed_exposure_us"},
           {"significant_bits = 8", "significant_bits"},
           {"leave_automatic = { focsu = true }", "did you mean 'focus'"},
           {"leave_automatic = { focus = 1 }", "true or false"},
           {"allow_mjpeg = true", "allow_mjpeg"},
           {"fourcc = \"H264\"", "compressed"},
           {"fourcc = \"XXXX\"", "YUYV"}}) {
    const absl::Status status = Parse(std::string("card = \"x\"\n") + bad + "\n", &options);
    EXPECT_FALSE(status.ok()) << bad;
    EXPECT_NE(status.message().find(word), std::string_view::npos) << status;
  }
}

}  // namespace
}  // namespace lightstage
