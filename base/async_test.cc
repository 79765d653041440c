#include "base/async.h"

#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;

TEST(PendingTest, ADeviceThatIsDoneAtOnceCostsNoTime) {
  VirtualClock clock;
  Pending<int> pending(clock);
  pending.sink()(7);
  EXPECT_TRUE(pending.done());
  EXPECT_EQ(pending.Wait(clock.Now(), "camera").value(), 7);
  EXPECT_EQ(clock.Now().time_since_epoch(), Duration::zero());
}

TEST(PendingTest, WaitsForATimer) {
  VirtualClock clock;
  Pending<int> pending(clock);
  clock.At(clock.Now() + seconds(2), [sink = pending.sink()]() mutable { std::move(sink)(8); });
  EXPECT_EQ(pending.Wait(clock.Now() + seconds(5), "camera").value(), 8);
  EXPECT_EQ(clock.Now().time_since_epoch(), seconds(2));
}

TEST(PendingTest, SilenceIsNamedAndALateAnswerIsHarmless) {
  VirtualClock clock;
  Completion<int> late;
  {
    Pending<int> pending(clock);
    late = pending.sink();
    auto result = pending.Wait(clock.Now() + seconds(1), "turntable move");
    EXPECT_EQ(result.status().code(), absl::StatusCode::kDeadlineExceeded);
    EXPECT_EQ(ErrorReason(result.status()), "DEVICE_SILENT");
    EXPECT_THAT(std::string(result.status().message()), HasSubstr("turntable move"));
  }
  std::move(late)(1);
}

TEST(PendingTest, AnswersFromAnotherThread) {
  RealClock clock;
  Pending<int> pending(clock);
  std::thread device(
      [sink = pending.sink()]() mutable { std::move(sink)(absl::DataLossError("frame")); });
  EXPECT_EQ(pending.Wait(clock.Now() + seconds(20), "camera").status().code(),
            absl::StatusCode::kDataLoss);
  device.join();
}

}  // namespace
}  // namespace lightstage
