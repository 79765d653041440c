#include "drivers/aravis/stream_counts.h"

#include <gtest/gtest.h>

namespace lightstage {
namespace {

using std::chrono::seconds;

TEST(StreamCounts, Text) {
  EXPECT_EQ(Text({.completed = 12, .failed = 1, .missing = 1, .requested = 3, .resent = 2}),
            "12 frames complete, 1 failed, 0 without a buffer; packets: 3 asked for again, 2 "
            "resent, 1 missing");
}

TEST(StreamCounts, CompleteFramesAreNothingWrong) {
  EXPECT_FALSE((StreamCounts{.completed = 7}).AnythingWrong());
  EXPECT_TRUE((StreamCounts{.completed = 7, .resent = 1}).AnythingWrong());
}

TEST(StreamCountsLog, SaysWhatGrewButNotTooOften) {
  StreamCountsLog log;
  const TimePoint start{};
  EXPECT_FALSE(log.Look({.completed = 5}, start));
  EXPECT_TRUE(log.Look({.completed = 6, .failed = 1, .missing = 4}, start + seconds(1)));
  EXPECT_FALSE(log.Look({.completed = 7, .failed = 1, .missing = 4}, start + seconds(30)))
      << "nothing grew";
  EXPECT_TRUE(log.Look({.completed = 8, .failed = 1, .missing = 5}, start + seconds(31)));
  EXPECT_FALSE(log.Look({.completed = 8, .failed = 1, .missing = 6}, start + seconds(32)))
      << "too soon";
  EXPECT_TRUE(log.Look({.completed = 9, .failed = 1, .missing = 6}, start + seconds(41)))
      << "what grew meanwhile is not forgotten";
}

TEST(StreamCountsLog, ANewStreamCountsAnew) {
  StreamCountsLog log;
  const TimePoint start{};
  EXPECT_TRUE(log.Look({.failed = 1}, start));
  log.Restart();
  EXPECT_FALSE(log.Look({.completed = 1}, start + seconds(20)));
  EXPECT_FALSE(log.Look({.failed = 1}, start + seconds(9))) << "too soon, as before";
  EXPECT_TRUE(log.Look({.failed = 1}, start + seconds(21)));
}

}  // namespace
}  // namespace lightstage
