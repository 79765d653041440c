#include "drivers/v4l2/controls.h"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>

#include "drivers/v4l2/fake_system.h"

namespace lightstage {
namespace {

class ControlsTest : public testing::Test {
 protected:
  VideoControls& Open(std::vector<FakeControl> controls) {
    controls_.reset();
    port_.reset();
    FakeSetup setup;
    setup.controls = std::move(controls);
    camera_ = std::make_unique<FakeCamera>(setup);
    system_.Add("/dev/video0", camera_.get());
    absl::StatusOr<VideoPort> port = VideoPort::Open(system_, "/dev/video0", "camera");
    EXPECT_TRUE(port.ok()) << port.status();
    port_ = std::make_unique<VideoPort>(*std::move(port));
    controls_ = std::make_unique<VideoControls>(*port_);
    return *controls_;
  }

  FakeVideoSystem system_;
  std::unique_ptr<FakeCamera> camera_;
  std::unique_ptr<VideoPort> port_;
  std::unique_ptr<VideoControls> controls_;
};

TEST_F(ControlsTest, EverythingAutomaticIsTurnedOff) {
  std::vector<FakeControl> all;
  for (const AutomaticControl& automatic : AutomaticControls()) {
    all.push_back({automatic.id, automatic.name, 0, 3, 1, automatic.off == 1 ? 3 : 1});
  }
  VideoControls& controls = Open(all);
  const absl::Status off = controls.TurnAutomaticOff({});
  EXPECT_TRUE(off.ok()) << off;
  for (const AutomaticControl& automatic : AutomaticControls()) {
    EXPECT_EQ(camera_->control(automatic.id), automatic.off) << automatic.name;
  }
  EXPECT_EQ(camera_->control(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(camera_->control(V4L2_CID_AUTO_WHITE_BALANCE), 0);
}

TEST_F(ControlsTest, WhatStaysOnIsNamedUnlessItMay) {
  VideoControls& controls =
      Open({{V4L2_CID_AUTOGAIN, "Gain, Automatic", 0, 1, 1, 1},
            {V4L2_CID_FOCUS_AUTO, "Focus, Automatic Continuous", 0, 1, 1, 1, 0, true}});
  const absl::Status off = controls.TurnAutomaticOff({});
  EXPECT_EQ(ErrorReason(off), "CONTROL_AUTOMATIC") << off;
  EXPECT_NE(off.message().find("Focus, Automatic Continuous"), std::string_view::npos) << off;
  EXPECT_NE(off.message().find("leave_automatic = { focus = true }"), std::string_view::npos);
  EXPECT_TRUE(controls.TurnAutomaticOff({"focus"}).ok());
  EXPECT_EQ(camera_->control(V4L2_CID_AUTOGAIN), 0);
  EXPECT_EQ(camera_->control(V4L2_CID_FOCUS_AUTO), 1);
}

// Many webcams know 50 and 60 Hz only.
TEST_F(ControlsTest, WhatHasNoOffIsNamed) {
  VideoControls& controls =
      Open({{V4L2_CID_POWER_LINE_FREQUENCY, "Power Line Frequency", 1, 2, 1, 1}});
  const absl::Status off = controls.TurnAutomaticOff({});
  EXPECT_EQ(ErrorReason(off), "CONTROL_AUTOMATIC") << off;
  EXPECT_NE(off.message().find("1 to 2"), std::string_view::npos) << off;
}

TEST_F(ControlsTest, ReadOnlyAndInactiveOnesCountByWhatTheyDo) {
  EXPECT_TRUE(Open({{V4L2_CID_AUTOGAIN, "Gain", 0, 1, 1, 0, V4L2_CTRL_FLAG_READ_ONLY},
                    {V4L2_CID_HUE_AUTO, "Hue", 0, 1, 1, 1, V4L2_CTRL_FLAG_INACTIVE, true},
                    {V4L2_CID_FOCUS_AUTO, "Focus", 0, 1, 1, 1, V4L2_CTRL_FLAG_DISABLED, true}})
                  .TurnAutomaticOff({})
                  .ok());
  const absl::Status on = Open({{V4L2_CID_AUTOGAIN, "Gain", 0, 1, 1, 1, V4L2_CTRL_FLAG_READ_ONLY}})
                              .TurnAutomaticOff({});
  EXPECT_EQ(ErrorReason(on), "CONTROL_AUTOMATIC") << on;
}

TEST_F(ControlsTest, AValueThatIsNotTakenIsAnError) {
  VideoControls& controls = Open({{V4L2_CID_GAIN, "Gain", 0, 255, 1, 7, 0, true}});
  const auto gain = controls.Find(V4L2_CID_GAIN);
  ASSERT_TRUE(gain.ok() && gain->has_value());
  EXPECT_EQ((*gain)->max, 255);
  const absl::Status set = controls.Set(**gain, 100);
  EXPECT_EQ(ErrorReason(set), "CONTROL_REFUSED") << set;
  EXPECT_NE(set.message().find("set to 100 and is 7"), std::string_view::npos) << set;
  EXPECT_TRUE(controls.Set(**gain, 7).ok());
  EXPECT_EQ(ErrorReason(controls.Set(**gain, 300)), "DEVICE_FAULT");
}

TEST_F(ControlsTest, ALostCameraIsNoMissingControl) {
  VideoControls& controls = Open({{V4L2_CID_AUTOGAIN, "Gain", 0, 1, 1, 1}});
  const auto missing = controls.Find(V4L2_CID_GAIN);
  ASSERT_TRUE(missing.ok());
  EXPECT_FALSE(missing->has_value());
  camera_->Unplug();
  EXPECT_EQ(ErrorReason(controls.Find(V4L2_CID_GAIN).status()), "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(controls.TurnAutomaticOff({})), "DEVICE_LOST");
}

}  // namespace
}  // namespace lightstage
