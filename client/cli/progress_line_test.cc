#include "client/cli/progress_line.h"

#include <sstream>

#include "base/env.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct Screen {
  explicit Screen(bool terminal, int columns = 80)
      : world{out, err, terminal, terminal, columns, clock, PosixEnv(), interrupt} {}
  std::string Take() {
    std::string text = err.str();
    err.str("");
    return text;
  }

  std::ostringstream out, err;
  VirtualClock clock;
  Canceller interrupt{clock};
  World world;
};

TEST(ProgressLine, DrawsABarOverItselfOnATerminal) {
  Screen screen(true, 40);
  ProgressLine line(screen.world);
  line.Show(0.5, "640/1280");
  EXPECT_EQ(screen.Take(), "\r[###########...........]  50%  640/1280\x1b[K");
  line.Clear();
  EXPECT_EQ(screen.Take(), "\r\x1b[K");
  line.Clear();
  EXPECT_EQ(screen.Take(), "");
  EXPECT_EQ(screen.out.str(), "");
}

TEST(ProgressLine, NeverWrapsOnANarrowTerminal) {
  Screen screen(true, 10);
  ProgressLine line(screen.world);
  line.Show(0.5, "640/1280  10.5/s");
  EXPECT_EQ(screen.Take(), "\r 50%  640\x1b[K");
}

TEST(ProgressLine, DropsWhatComesTooFastUnlessItIsNew) {
  Screen screen(true);
  ProgressLine line(screen.world);
  line.Show(0, "first");
  screen.Take();
  line.Show(0, "too soon");
  EXPECT_EQ(screen.Take(), "");
  line.Show(0, "paused", /*now=*/true);
  EXPECT_THAT(screen.Take(), ::testing::HasSubstr("paused"));
  SleepFor(screen.clock, milliseconds(100));
  line.Show(0, "later");
  EXPECT_THAT(screen.Take(), ::testing::HasSubstr("later"));
}

TEST(ProgressLine, WritesAPlainLineEveryFiveSecondsElsewhere) {
  Screen screen(false);
  ProgressLine line(screen.world);
  for (int i = 0; i < 11; ++i) {
    line.Show(i / 10.0, absl::StrCat(i));
    SleepFor(screen.clock, seconds(1));
  }
  EXPECT_EQ(screen.Take(), "  0%  0\n 50%  5\n100%  10\n");
}

TEST(ProgressLine, SharesOutOfRangeAreDrawnAsWhole) {
  Screen screen(false);
  ProgressLine line(screen.world);
  line.Show(2, "x", true);
  line.Show(-1, "x", true);
  line.Show(0.0 / 0.0, "x", true);
  EXPECT_EQ(screen.Take(), "100%  x\n  0%  x\n  0%  x\n");
}

}  // namespace
}  // namespace lightstage::client
