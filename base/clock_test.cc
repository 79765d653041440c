#include "base/clock.h"

#include <atomic>
#include <thread>
#include <vector>

#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::ElementsAre;

TEST(UtcTest, FormatsAndParses) {
  WallTime t = ParseUtc("2004-02-29T23:59:59.000001Z").value();
  EXPECT_EQ(FormatUtc(t), "2004-02-29T23:59:59.000001Z");
  EXPECT_EQ(FormatUtc(WallTime{}), "1970-01-01T00:00:00.000000Z");
  EXPECT_EQ(ParseUtc("1970-01-01T01:00:00+01:00").value(), WallTime{});
  EXPECT_EQ(ErrorReason(ParseUtc("yesterday").status()), "TIME_INVALID");
}

TEST(VirtualClockTest, WaitingMovesTimeAndRunsTimersInOrder) {
  VirtualClock clock;
  TimePoint start = clock.Now();
  std::vector<int> order;
  clock.At(start + seconds(2), [&] { order.push_back(2); });
  clock.At(start + seconds(1), [&] { order.push_back(1); });
  clock.At(start + seconds(2), [&] { order.push_back(3); });  // same time: in order of registration
  clock.At(start + seconds(9), [&] { order.push_back(9); });
  EXPECT_FALSE(clock.WaitUntil(start + seconds(5), [] { return false; }));
  EXPECT_THAT(order, ElementsAre(1, 2, 3));
  EXPECT_EQ(clock.Now(), start + seconds(5));
}

TEST(VirtualClockTest, StopsAtTheMomentTheConditionHolds) {
  VirtualClock clock;
  bool ready = false;
  clock.At(clock.Now() + milliseconds(250), [&] { ready = true; });
  EXPECT_TRUE(clock.WaitUntil(clock.Now() + seconds(100), [&] { return ready; }));
  EXPECT_EQ(clock.Now().time_since_epoch(), milliseconds(250));
}

TEST(VirtualClockTest, ATimerMaySetAnother) {
  VirtualClock clock;
  int left = 3;
  std::function<void()> tick = [&] {
    if (--left > 0) clock.At(clock.Now() + seconds(1), [&] { tick(); });
  };
  clock.At(clock.Now() + seconds(1), [&] { tick(); });
  EXPECT_TRUE(clock.WaitUntil(kNever, [&] { return left == 0; }));
  EXPECT_EQ(clock.Now().time_since_epoch(), seconds(3));
}

TEST(VirtualClockTest, CancelledTimersDoNotRun) {
  VirtualClock clock;
  bool ran = false;
  auto id = clock.At(clock.Now() + seconds(1), [&] { ran = true; });
  EXPECT_TRUE(clock.Cancel(id));
  EXPECT_FALSE(clock.Cancel(id));
  SleepFor(clock, seconds(2));
  EXPECT_FALSE(ran);
}

TEST(VirtualClockTest, AnotherThreadsNotifyEndsAWaitWithoutMovingTime) {
  VirtualClock clock;
  std::atomic<bool> ready = false;
  std::thread other([&] {
    std::this_thread::sleep_for(milliseconds(10));
    ready = true;
    clock.Notify();
  });
  EXPECT_TRUE(clock.WaitUntil(kNever, [&] { return ready.load(); }));
  EXPECT_EQ(clock.Now().time_since_epoch(), Duration::zero());
  other.join();
}

TEST(VirtualClockTest, WallTimeFollows) {
  WallTime epoch = ParseUtc("2004-05-06T00:00:00Z").value();
  VirtualClock clock(epoch);
  SleepFor(clock, seconds(90));
  EXPECT_EQ(FormatUtc(clock.WallNow()), "2004-05-06T00:01:30.000000Z");
  EXPECT_TRUE(clock.is_virtual());
}

TEST(RealClockTest, TimersRunAtTheirTimeInOrder) {
  RealClock clock;
  EXPECT_FALSE(clock.is_virtual());
  TimePoint start = clock.Now();
  std::vector<int> order;
  std::atomic<bool> done = false;
  TimePoint ran_at{};
  clock.At(start + milliseconds(20), [&] {
    order.push_back(2);
    ran_at = clock.Now();
    done = true;
    clock.Notify();
  });
  clock.At(start + milliseconds(10), [&] { order.push_back(1); });
  EXPECT_TRUE(clock.WaitUntil(start + seconds(20), [&] { return done.load(); }));
  EXPECT_THAT(order, ElementsAre(1, 2));
  EXPECT_GE(ran_at, start + milliseconds(20));
}

TEST(RealClockTest, WaitsEndAtTheirDeadlineAndNotBefore) {
  RealClock clock;
  TimePoint start = clock.Now();
  EXPECT_FALSE(clock.WaitUntil(start + milliseconds(15), [] { return false; }));
  EXPECT_GE(clock.Now(), start + milliseconds(15));
  EXPECT_TRUE(clock.WaitUntil(start - seconds(1), [] { return true; }));
  EXPECT_FALSE(clock.WaitUntil(start - seconds(1), [] { return false; }));
}

TEST(RealClockTest, NotifyWakesAWaiter) {
  RealClock clock;
  std::atomic<bool> ready = false;
  std::thread other([&] {
    ready = true;
    clock.Notify();
  });
  EXPECT_TRUE(clock.WaitUntil(clock.Now() + seconds(20), [&] { return ready.load(); }));
  other.join();
}

TEST(RealClockTest, CancelAndDestructionWithTimersLeft) {
  bool ran = false;
  {
    RealClock clock;
    auto id = clock.At(clock.Now() + milliseconds(5), [&] { ran = true; });
    clock.At(clock.Now() + seconds(1000), [&] { ran = true; });
    EXPECT_TRUE(clock.Cancel(id));
    SleepFor(clock, milliseconds(10));
  }
  EXPECT_FALSE(ran);
}

TEST(DurationTest, Seconds) {
  EXPECT_EQ(FromSeconds(0.0005), microseconds(500));
  EXPECT_DOUBLE_EQ(Seconds(milliseconds(1500)), 1.5);
}

}  // namespace
}  // namespace lightstage
