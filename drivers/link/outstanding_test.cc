#include "drivers/link/outstanding.h"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

namespace lightstage {
namespace {

struct Log {
  std::string order;
  std::unique_ptr<CameraShot> shot;
  Log() {
    shot = std::make_unique<CameraShot>(
        Duration(1), kNever,
        [this](absl::StatusOr<ExposureEnd> end) { order += end.ok() ? "E" : "e"; },
        [this](absl::StatusOr<Frame> frame) { order += frame.ok() ? "F" : "f"; });
  }
};

TEST(CameraShot, EndsThenDelivers) {
  Log log;
  log.shot->EndExposure(TimePoint{});
  log.shot->EndExposure(TimePoint{});
  EXPECT_FALSE(log.shot->finished());
  EXPECT_TRUE(log.shot->Finish(Frame{}));
  EXPECT_FALSE(log.shot->Fail(absl::CancelledError()));
  EXPECT_EQ(log.order, "EF");
}

TEST(CameraShot, FailureFailsBothInOrder) {
  Log log;
  EXPECT_TRUE(log.shot->Fail(absl::CancelledError()));
  log.shot->EndExposure(TimePoint{});
  EXPECT_EQ(log.order, "ef");
}

TEST(CameraShot, FailureAfterTheExposureFailsTheFrameOnly) {
  Log log;
  log.shot->EndExposure(TimePoint{});
  log.shot->Fail(absl::CancelledError());
  EXPECT_EQ(log.order, "Ef");
}

// Whoever finishes the shot while exposure_ended runs must not overtake it.
TEST(CameraShot, OrderHoldsAcrossThreads) {
  std::atomic<bool> inside{false}, finished{false};
  std::string order;
  CameraShot shot(
      Duration(1), kNever,
      [&](absl::StatusOr<ExposureEnd>) {
        inside = true;
        while (!finished) std::this_thread::yield();
        order += "E";
      },
      [&](absl::StatusOr<Frame>) { order += "f"; });
  std::thread ender([&] { shot.EndExposure(TimePoint{}); });
  while (!inside) std::this_thread::yield();
  EXPECT_TRUE(shot.Fail(absl::CancelledError()));
  finished = true;
  ender.join();
  shot.AwaitIdle();
  EXPECT_EQ(order, "Ef");
}

TEST(Operation, CompletesOnce) {
  int calls = 0;
  Operation<int> operation([&](absl::StatusOr<int> result) { calls += result.ok() ? 1 : 100; });
  EXPECT_FALSE(operation.finished());
  EXPECT_TRUE(operation.Complete(5));
  EXPECT_FALSE(operation.Fail(absl::CancelledError()));
  EXPECT_EQ(calls, 1);
  EXPECT_TRUE(operation.finished());
}

}  // namespace
}  // namespace lightstage
