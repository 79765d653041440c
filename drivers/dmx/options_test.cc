#include "drivers/dmx/options.h"

#include <gtest/gtest.h>

namespace lightstage::dmx {
namespace {

absl::Status Parse(const std::string& text, DmxOptions* options) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse("[lamps]\n" + text, "rig.toml");
  if (!document.ok()) return document.status();
  *options = ParseDmxOptions(document->root().Table("lamps"));
  return document->Finish();
}

TEST(DmxOptions, EveryKeyIsRead) {
  DmxOptions options;
  absl::Status status = Parse(
      "widget = \"open\"\nserial = \"AQ02FHLY\"\naddress = \"1-2.3\"\nchannels = [1, 7, 3]\n"
      "bits = 16\nslots = 48\nsettle_ms = 12.5\nframe_hz = 44\n",
      &options);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(options.widget, WidgetKind::kOpen);
  EXPECT_EQ(options.device.serial, "AQ02FHLY");
  EXPECT_EQ(options.device.address, "1-2.3");
  EXPECT_EQ(options.channels.first, (std::vector<int>{1, 7, 3}));
  EXPECT_EQ(options.channels.bits, 16);
  EXPECT_EQ(options.channels.slots, 48);
  EXPECT_EQ(options.settle, std::chrono::microseconds(12500));
  EXPECT_DOUBLE_EQ(options.frame_hz, 44);
}

TEST(DmxOptions, ARowOfLampsIsFirstCountAndStep) {
  DmxOptions options;
  const std::string base = "widget = \"pro\"\nserial = \"EN396804\"\nsettle_ms = 0\n";
  ASSERT_TRUE(Parse(base + "first_channel = 5\nlamp_count = 3\n", &options).ok());
  EXPECT_EQ(options.widget, WidgetKind::kPro);
  EXPECT_EQ(options.channels.first, (std::vector<int>{5, 6, 7}));
  EXPECT_EQ(options.channels.slots, 512);
  ASSERT_TRUE(Parse(base + "first_channel = 5\nlamp_count = 3\nbits = 16\n", &options).ok());
  EXPECT_EQ(options.channels.first, (std::vector<int>{5, 7, 9}));
  absl::Status status =
      Parse(base + "first_channel = 2\nlamp_count = 103\nchannel_step = 5\n", &options);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(options.channels.first.back(), 512);
}

// The error names the key, its line, and what is in the way.
TEST(DmxOptions, ChannelsAreOneLampsOnlyAndOnTheUniverse) {
  const std::string base = "widget = \"open\"\nserial = \"A\"\nsettle_ms = 0\n";
  const std::pair<const char*, const char*> kWrong[] = {
      {"channels = [1, 2, 1]", "channel 1 is used twice, by lamp 0 and lamp 2"},
      {"channels = [1, 2]\nbits = 16", "channel 2 is used twice"},
      {"channels = [512]\nbits = 16", "lamp 0 would have channel 513"},
      {"channels = [25]\nslots = 24", "lamp 0 would have channel 25"},
      {"channels = [1.5]", "1.5 is no channel"},
      {"channels = []", "at least one"},
      {"channels = [0]", "channels"},
      {"channels = [513]", "channels"},
      {"first_channel = 500\nlamp_count = 20", "lamp 13 would have channel 513"},
      {"first_channel = 1\nlamp_count = 2\nbits = 16\nchannel_step = 1", "channel 2 is used twice"},
  };
  for (const auto& [text, message] : kWrong) {
    DmxOptions options;
    absl::Status status = Parse(base + text + "\n", &options);
    EXPECT_FALSE(status.ok()) << text;
    EXPECT_NE(status.message().find(message), std::string_view::npos) << text << ": " << status;
    EXPECT_NE(status.message().find("rig.toml:5"), std::string_view::npos)
        << text << ": " << status;
  }
}

TEST(DmxOptions, BadValuesAndUnknownKeysAreRefused) {
  const std::string good =
      "widget = \"open\"\nserial = \"A\"\nsettle_ms = 0\nfirst_channel = 1\nlamp_count = 4\n";
  DmxOptions options;
  ASSERT_TRUE(Parse(good, &options).ok());
  EXPECT_DOUBLE_EQ(options.frame_hz, 30);
  for (const char* bad :
       {"bits = 12", "bits = 32", "slots = 23", "slots = 513", "frame_hz = 4", "frame_hz = 45",
        "frame_hz = nan", "channels = [1]", "address = \"1\"", "address = \"1-\"",
        "address = \"1-2.\"", "address = \"1.2-3\"", "address = \"-1\"", "address = \"1-2-3\"",
        "channel_step = 0", "chanels = [1]", "frame_rate = 30"}) {
    EXPECT_FALSE(Parse(good + bad + "\n", &options).ok()) << bad;
  }
  // A short universe may be sent more often.
  EXPECT_TRUE(Parse(good + "slots = 24\nframe_hz = 200\n", &options).ok());
}

TEST(DmxOptions, WhatMustBeSaidMustBeSaid) {
  const std::string kAll[] = {"widget = \"open\"\n", "serial = \"A\"\n", "settle_ms = 0\n",
                              "first_channel = 1\n", "lamp_count = 4\n"};
  for (size_t without = 0; without < std::size(kAll); ++without) {
    std::string text;
    for (size_t i = 0; i < std::size(kAll); ++i) {
      if (i != without) text += kAll[i];
    }
    DmxOptions options;
    EXPECT_FALSE(Parse(text, &options).ok()) << text;
  }
  DmxOptions options;
  EXPECT_FALSE(
      Parse("widget = \"pro\"\nserial = \"A\"\nsettle_ms = 0\nchannels = [1]\nframe_hz = 30\n",
            &options)
          .ok());
}

}  // namespace
}  // namespace lightstage::dmx
