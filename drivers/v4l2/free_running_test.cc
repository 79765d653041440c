#include "drivers/v4l2/free_running.h"

#include <gtest/gtest.h>
#include <time.h>

namespace lightstage {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

TimePoint At(int ms) { return TimePoint(hours(1)) + milliseconds(ms); }

FrameStamp Stamped(int stamp, int not_before, int dequeued) {
  return {At(stamp), false, At(not_before), At(dequeued)};
}

// CLOCK_MONOTONIC, which the kernel stamps with, is the rig's clock.
TEST(FreeRunning, TheKernelsClockIsTheRigs) {
  RealClock clock;
  const TimePoint before = clock.Now();
  timespec now;
  ASSERT_EQ(clock_gettime(CLOCK_MONOTONIC, &now), 0);
  const TimePoint kernel(std::chrono::seconds(now.tv_sec) + Duration(now.tv_nsec));
  EXPECT_LE(before, kernel);
  EXPECT_LE(kernel, clock.Now());
}

TEST(FreeRunning, LightIsCountedBackFromTheStamp) {
  ExposureTiming timing;
  timing.latency = milliseconds(7);
  EXPECT_EQ(EarliestLight(Stamped(100, 80, 101), milliseconds(10), timing), At(83));
  EXPECT_EQ(LikelyExposureEnd(Stamped(100, 80, 101), milliseconds(10), timing), At(93));
}

TEST(FreeRunning, WithoutLatencyReadoutMayTakeAWholeFrame) {
  ExposureTiming timing;
  timing.interval = milliseconds(20);
  EXPECT_EQ(EarliestLight(Stamped(100, 80, 101), milliseconds(10), timing), At(70));
}

// uvcvideo flags its stamps as start of exposure and takes them from the first packet: believed only if asked.
TEST(FreeRunning, StartOfExposureIsBelievedOnlyIfAsked) {
  FrameStamp frame = Stamped(100, 80, 130);
  frame.flagged_start_of_exposure = true;
  ExposureTiming timing;
  timing.latency = milliseconds(1);
  EXPECT_EQ(EarliestLight(frame, milliseconds(10), timing), At(89));
  timing.stamps_at_exposure_start = true;
  EXPECT_EQ(EarliestLight(frame, milliseconds(10), timing), At(99));
  EXPECT_EQ(LikelyExposureEnd(frame, milliseconds(10), timing), At(109));
  EXPECT_EQ(LikelyExposureEnd(frame, milliseconds(60), timing), At(130));
  frame.flagged_start_of_exposure = false;
  EXPECT_EQ(EarliestLight(frame, milliseconds(10), timing), At(89));
}

TEST(FreeRunning, StampsOfTheFutureOrOfAnotherClockAreNotBelieved) {
  ExposureTiming timing;
  timing.latency = milliseconds(0);
  EXPECT_EQ(EarliestLight(Stamped(110, 80, 101), milliseconds(10), timing), At(70));
  EXPECT_EQ(LikelyExposureEnd(Stamped(110, 80, 101), milliseconds(10), timing), At(101));
  FrameStamp unknown = Stamped(0, 80, 101);
  unknown.stamp.reset();
  EXPECT_EQ(EarliestLight(unknown, milliseconds(10), timing), At(70));
}

// What the latency is measured against does not depend on the one that is set, and is never too early.
TEST(FreeRunning, TheLatestStartIsThatWithoutLatency) {
  FrameStamp frame = Stamped(100, 80, 130);
  frame.flagged_start_of_exposure = true;
  for (std::optional<Duration> latency :
       {std::optional<Duration>(), std::optional<Duration>(milliseconds(7))}) {
    ExposureTiming timing;
    timing.latency = latency;
    timing.interval = milliseconds(20);
    EXPECT_EQ(LatestStart(frame, milliseconds(10), timing), At(90));
    EXPECT_EQ(LatestStart(Stamped(140, 80, 130), milliseconds(10), timing), At(120));
    timing.stamps_at_exposure_start = true;
    EXPECT_EQ(LatestStart(frame, milliseconds(10), timing), At(100));
    EXPECT_EQ(LatestStart(frame, milliseconds(60), timing), At(100))
        << "LikelyExposureEnd() is cut off";
  }
}

TEST(FreeRunning, FramesAreChosenAfterTheLightAndAfterTheSkips) {
  FrameChoice exact(At(50), 0);
  EXPECT_FALSE(exact.Counts(At(49)));
  EXPECT_TRUE(exact.Counts(At(50)));
  FrameChoice careful(At(50), 2);
  EXPECT_FALSE(careful.Counts(At(30)));
  EXPECT_FALSE(careful.Counts(At(60)));
  EXPECT_FALSE(careful.Counts(At(80)));
  EXPECT_TRUE(careful.Counts(At(100)));
}

TEST(FreeRunning, NumbersRiseOverStreamsAndWraps) {
  FrameCounter counter;
  EXPECT_EQ(counter.Next(7).sequence, 1u);
  FrameCounter::Step step = counter.Next(8);
  EXPECT_EQ(step.sequence, 2u);
  EXPECT_EQ(step.skipped, 0u);
  step = counter.Next(12);
  EXPECT_EQ(step.sequence, 6u);
  EXPECT_EQ(step.skipped, 3u);
  counter.Restart();
  step = counter.Next(0);
  EXPECT_EQ(step.sequence, 7u);
  EXPECT_FALSE(step.backwards);
  counter.Restart();
  counter.Next(UINT32_MAX - 1);
  step = counter.Next(1);
  EXPECT_FALSE(step.backwards);
  EXPECT_EQ(step.skipped, 2u);
  EXPECT_EQ(step.sequence, 11u);
}

TEST(FreeRunning, NumbersThatGoBackAreSeen) {
  FrameCounter counter;
  counter.Next(100);
  FrameCounter::Step step = counter.Next(99);
  EXPECT_TRUE(step.backwards);
  EXPECT_EQ(step.skipped, 0u);
  EXPECT_EQ(step.sequence, 2u);
  EXPECT_TRUE(counter.Next(99).backwards);
  EXPECT_FALSE(counter.Next(100).backwards);
}

}  // namespace
}  // namespace lightstage
