#include "drivers/dlpc350/options.h"

#include <gtest/gtest.h>

#include "absl/strings/str_replace.h"

namespace lightstage::dlpc350 {
namespace {

absl::Status Parse(const std::string& text, Options* options) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse("[projector]\n" + text, "rig.toml");
  if (!document.ok()) return document.status();
  *options = ParseOptions(document->root().Table("projector"));
  return document->Finish();
}

const char kFlash[] = R"(mode = "flash"
serial = "LCR1"
led_current = [50, 60, 0]
led_current_limit = 100
settle_ms = 1.5
leds = "yellow"
exposure_us = 10000
period_us = 10230
trigger_in = "falling"
trigger_in_delay_us = 1.072
trigger_out1_invert = true
trigger_out1_rise_us = -20.05
trigger_out1_fall_us = 2.787
trigger_out2_rise_us = 0
[[projector.patterns]]
arrangement = "full"
number = 24
depth = 1
image = 0
[[projector.patterns]]
arrangement = "horizontal"
profile = "gaussian"
grid = 16
influence = 2
column = 1
row = 5
image = 3
number = 2
depth = 8
invert = true
[[projector.patterns]]
arrangement = "square"
grid = 6
every_square = true
image = 5
number = 22
depth = 1
)";

TEST(Dlpc350Options, EveryKeyIsRead) {
  Options options;
  absl::Status status = Parse(kFlash, &options);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_TRUE(options.flash);
  EXPECT_EQ(options.serial, "LCR1");
  EXPECT_EQ(options.current, (std::array<uint8_t, 3>{50, 60, 0}));
  EXPECT_EQ(options.settle, std::chrono::microseconds(1500));
  EXPECT_EQ(options.leds, 3);
  EXPECT_EQ(options.exposure_us, 10000u);
  EXPECT_EQ(options.period_us, 10230u);
  EXPECT_EQ(options.trigger_in, 2);
  EXPECT_DOUBLE_EQ(options.trigger_in_delay_us, 1.072);
  EXPECT_EQ(options.trigger_out1, (std::array<uint8_t, 3>{1, 0x00, 0xD5}));
  EXPECT_EQ(options.trigger_out2, (std::array<uint8_t, 2>{0, 0xBB}));
  EXPECT_EQ(options.patterns.size(), 1u + 1u + 36u);
  Pattern row;
  row.arrangement = PatternArrangement::kHorizontal;
  row.profile = PatternProfile::kGaussian;
  row.grid = 16;
  row.influence = 2;
  row.column = 1;
  row.row = 5;
  ASSERT_TRUE(options.patterns.contains(row));
  const StoredPattern& stored = options.patterns[row];
  EXPECT_EQ(stored.image, 3);
  EXPECT_EQ(stored.number, 2);
  EXPECT_EQ(stored.depth, 8);
  EXPECT_TRUE(stored.invert);
}

TEST(Dlpc350Options, SquaresFillTheBitPlanesOfOneImageAfterTheOther) {
  Options options;
  ASSERT_TRUE(Parse(kFlash, &options).ok());
  Pattern square;
  square.arrangement = PatternArrangement::kSquare;
  square.grid = 6;
  auto at = [&](int column, int row) {
    square.column = column;
    square.row = row;
    const StoredPattern& stored = options.patterns.at(square);
    return std::pair(stored.image, stored.number);
  };
  EXPECT_EQ(at(0, 0), std::pair(5, 22));
  EXPECT_EQ(at(1, 0), std::pair(5, 23));
  EXPECT_EQ(at(2, 0), std::pair(6, 0));
  EXPECT_EQ(at(5, 5), std::pair(7, 9));
}

TEST(Dlpc350Options, FieldsThatMakeNoDifferenceAreNotLookedAt) {
  Pattern full;
  full.arrangement = PatternArrangement::kFull;
  Pattern other = full;
  other.grid = 16;
  other.profile = PatternProfile::kHat;
  EXPECT_EQ(Canonical(other), full);
  Pattern square;
  square.arrangement = PatternArrangement::kSquare;
  square.grid = 8;
  Pattern spaced = square;
  spaced.influence = 3;
  EXPECT_EQ(Canonical(spaced), square);
  spaced.arrangement = PatternArrangement::kVertical;
  EXPECT_EQ(Canonical(spaced), spaced);
}

TEST(Dlpc350Options, VideoNeedsLittle) {
  Options options;
  absl::Status status =
      Parse("mode = \"video\"\nled_current = [1, 2, 3]\nled_current_limit = 3\n", &options);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_FALSE(options.flash);
  EXPECT_FALSE(Parse("mode = \"video\"\nled_current = [1, 2, 3]\nled_current_limit = 3\n"
                     "exposure_us = 9000\n",
                     &options)
                   .ok());
}

TEST(Dlpc350Options, CurrentsAreLimited) {
  Options options;
  absl::Status status =
      Parse("mode = \"video\"\nled_current = [1, 101, 3]\nled_current_limit = 100\n", &options);
  EXPECT_NE(status.message().find("101"), std::string_view::npos) << status;
  EXPECT_FALSE(Parse("mode = \"video\"\nled_current = [1, 2, 3]\n", &options).ok())
      << "the limit must be said";
}

TEST(Dlpc350Options, BadValuesAndUnknownKeysAreRefused) {
  const std::pair<const char*, const char*> changes[] = {
      {"mode = \"flash\"", "mode = \"hdmi\""},
      {"period_us = 10230", "period_us = 10229"},
      {"period_us = 10230", "period_us = 9000"},
      {"period_us = 10230", "period_us = 10000"},  // with trigger_in
      {"exposure_us = 10000", "exposure_us = 100"},
      {"leds = \"yellow\"", "leds = \"black\""},
      {"led_current = [50, 60, 0]", "led_current = [50, 60]"},
      {"led_current = [50, 60, 0]", "led_current = [50, 60.5, 0]"},
      {"trigger_out1_rise_us = -20.05", "trigger_out1_rise_us = -20.2"},
      {"number = 24\ndepth = 1", "number = 12\ndepth = 2"},
      {"number = 24\ndepth = 1", "number = 25\ndepth = 1"},
      {"image = 3", "image = 64"},
      {"image = 5", "image = 63"},
      {"row = 5", "row = 16"},
      {"grid = 6", "grid = 40"},
      {"every_square = true", "every_square = true\ncolumn = 1"},
      {"arrangement = \"square\"", "arrangement = \"full\""},
      {"serial = ", "seral = "},
  };
  Options options;
  for (auto [good, bad] : changes) {
    const std::string text = absl::StrReplaceAll(kFlash, {{good, bad}});
    ASSERT_NE(text, kFlash) << good;
    EXPECT_FALSE(Parse(text, &options).ok()) << bad;
  }
  EXPECT_FALSE(
      Parse("mode = \"flash\"\nled_current = [1, 2, 3]\nled_current_limit = 3\n", &options).ok())
      << "flash without patterns";
}

}  // namespace
}  // namespace lightstage::dlpc350
