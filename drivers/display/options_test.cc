#include "drivers/display/options.h"

#include <gtest/gtest.h>

namespace lightstage {
namespace {

absl::Status Parse(const std::string& text, DisplayOptions* options) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse("[projector]\n" + text, "rig.toml");
  if (!document.ok()) return document.status();
  *options = ParseDisplayOptions(document->root().Table("projector"));
  return document->Finish();
}

TEST(DisplayOptions, EveryKeyIsRead) {
  DisplayOptions options;
  absl::Status status = Parse(
      "backend = \"x11\"\nx_display = \":3\"\noutput = \"HDMI-1\"\nrenderer = \"software\"\n"
      "frames = 3\ngamma = 2.2\nsettle_ms = 12.5\n",
      &options);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(options.screen.backend, "x11");
  EXPECT_EQ(options.screen.x_display, ":3");
  EXPECT_EQ(options.screen.output, "HDMI-1");
  EXPECT_EQ(options.screen.output_index, -1);
  EXPECT_EQ(options.screen.renderer, "software");
  EXPECT_EQ(options.screen.frames, 3);
  EXPECT_DOUBLE_EQ(options.gamma, 2.2);
  EXPECT_EQ(options.settle, std::chrono::microseconds(12500));
  ASSERT_TRUE(Parse("backend = \"kmsdrm\"\noutput_index = 1\n", &options).ok());
  EXPECT_EQ(options.screen.backend, "kmsdrm");
  EXPECT_EQ(options.screen.output_index, 1);
  EXPECT_EQ(options.screen.frames, 2);
  EXPECT_EQ(options.gamma, 1) << "codes go out as they are";
}

TEST(DisplayOptions, TheOutputMustBeSaidOnce) {
  DisplayOptions options;
  EXPECT_NE(Parse("frames = 2\n", &options).message().find("output_index"), std::string_view::npos);
  EXPECT_FALSE(Parse("output = \"DP-1\"\noutput_index = 0\n", &options).ok());
}

TEST(DisplayOptions, BadValuesAndUnknownKeysAreRefused) {
  DisplayOptions options;
  for (const char* bad : {"frames = 0", "frames = 61", "gamma = 0", "gamma = nan",
                          "backend = \"wayland\"", "renderer = \"fast\"", "settle_ms = -1",
                          "brightness = 3", "backend = \"kmsdrm\"\nx_display = \":0\""}) {
    EXPECT_FALSE(Parse(std::string("output = \"DP-1\"\n") + bad + "\n", &options).ok()) << bad;
  }
}

}  // namespace
}  // namespace lightstage
