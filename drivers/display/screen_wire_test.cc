#include "drivers/display/screen_wire.h"

#include <gtest/gtest.h>

#include "base/status.h"

namespace lightstage {
namespace {

TEST(ScreenWire, RepliesComeBackAsTheyWent) {
  ScreenInfo info{"HDMI-1", 1280, 800, 59.95, "opengl", true, "a\nnote"};
  absl::StatusOr<ScreenInfo> back = ParseScreenReply(EncodeScreenReply(info));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->output, "HDMI-1");
  EXPECT_EQ(back->width, 1280);
  EXPECT_EQ(back->height, 800);
  EXPECT_NEAR(back->refresh_hz, 59.95, 1e-3);
  EXPECT_EQ(back->renderer, "opengl");
  EXPECT_TRUE(back->paced);
  EXPECT_EQ(back->note, "a note");

  absl::Status error =
      Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "output HDMI-1\nwas unplugged");
  absl::Status told = ParseScreenReply(EncodeScreenReply(error)).status();
  EXPECT_EQ(told.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(ErrorReason(told), "DEVICE_LOST");
  EXPECT_EQ(told.message(), "output HDMI-1 was unplugged");
  EXPECT_LE(EncodeScreenReply(ScreenInfo{std::string(5000, 'x'), 1, 1, 0, std::string(5000, 'y'),
                                         false, std::string(5000, 'z')})
                .size(),
            kMaxScreenReply);
}

TEST(ScreenWire, WhatIsNoReplyIsRefused) {
  const std::string good = EncodeScreenReply(ScreenInfo{"DP-1", 64, 48, 60, "software", false, ""});
  for (size_t length = 0; length < good.size(); ++length) {
    EXPECT_EQ(ErrorReason(ParseScreenReply(good.substr(0, length)).status()), "SCREEN_REPLY")
        << length;
  }
  for (const char* bad :
       {"error\n0\nX\nmessage\n", "error\n17\nX\nmessage\n", "error\nx\nX\nmessage\n",
        "ok\nDP-1\n0\n48\n60000\nr\n0\n\n", "ok\nDP-1\n64\n-48\n60000\nr\n0\n\n",
        "ok\nDP-1\n64\n48\n60000\nr\n2\n\n", "ok\nDP-1\n64\n48\n99999999999999\nr\n0\n\n",
        "ok\nDP-1\n64\n48\n60000\nr\n0\n\nmore\n"}) {
    EXPECT_EQ(ErrorReason(ParseScreenReply(bad).status()), "SCREEN_REPLY") << bad;
  }
}

}  // namespace
}  // namespace lightstage
