#include "client/cpp/control_lease.h"

#include <atomic>

#include "client/cpp/testing/fake_daemon.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class ControlLeaseTest : public ::testing::Test {
 protected:
  void SetUp() override {
    daemon_.Change([](FakeState& s) { s.heartbeat_seconds = 1.5; });
    auto connection = Connect(daemon_.address(), clock_, canceller_);
    ASSERT_TRUE(connection.ok()) << connection.status();
    connection_ = *std::move(connection);
  }
  absl::StatusOr<std::unique_ptr<ControlLease>> Acquire() {
    return ControlLease::Acquire(*connection_, "anna@lab3", "testing", canceller_,
                                 [this](const absl::Status&) {
                                   ++lost_;
                                   clock_.Notify();
                                 });
  }
  bool WaitUntilLost() {
    return clock_.WaitUntil(clock_.Now() + seconds(30), [this] { return lost_ > 0; });
  }

  FakeDaemon daemon_;
  RealClock clock_;
  Canceller canceller_{clock_};
  std::unique_ptr<Connection> connection_;
  std::atomic<int> lost_{0};
};

TEST_F(ControlLeaseTest, RenewsThreeTimesAHeartbeatAndReleasesAtItsEnd) {
  TimePoint start = clock_.Now();
  {
    auto lease = Acquire();
    ASSERT_TRUE(lease.ok()) << lease.status();
    EXPECT_EQ((*lease)->token(), daemon_.Snapshot().token);
    EXPECT_EQ(daemon_.Snapshot().holder, "anna@lab3");
    EXPECT_EQ(daemon_.Snapshot().note, "testing");
    ASSERT_TRUE(daemon_.Eventually([](const FakeState& s) { return s.renewals >= 3; }));
    // A whole heartbeat, no sooner.
    EXPECT_GE(clock_.Now() - start, milliseconds(1450));
    EXPECT_TRUE((*lease)->status().ok());
  }
  EXPECT_EQ(daemon_.Snapshot().holder, "");
  EXPECT_EQ(daemon_.Calls().back(), "ReleaseControl");
  EXPECT_EQ(lost_, 0);
}

TEST_F(ControlLeaseTest, SaysWhoHasControl) {
  daemon_.Change([](FakeState& s) { s.holder = "bert@lab1"; });
  auto lease = Acquire();
  EXPECT_EQ(ErrorReason(lease.status()), "CONTROL_HELD");
  EXPECT_EQ(ErrorMetadataOf(lease.status()), (ErrorMetadata{{"owner", "bert@lab1"}}));
}

TEST_F(ControlLeaseTest, TellsOnceWhenTheDaemonEndedIt) {
  auto lease = Acquire();
  ASSERT_TRUE(lease.ok()) << lease.status();
  daemon_.Change([](FakeState& s) { s.token = "of somebody else"; });
  ASSERT_TRUE(WaitUntilLost());
  EXPECT_EQ(ErrorReason((*lease)->status()), "CONTROL_LOST");
  lease->reset();
  EXPECT_EQ(lost_, 1);
  EXPECT_EQ(daemon_.Calls().back(), "RenewControl");  // a lease that is lost is not released
}

TEST_F(ControlLeaseTest, IsLostWhenNoRenewalGetsThroughForAHeartbeat) {
  auto lease = Acquire();
  ASSERT_TRUE(lease.ok()) << lease.status();
  daemon_.Stop();
  ASSERT_TRUE(WaitUntilLost());
  EXPECT_EQ(ErrorReason((*lease)->status()), "CONTROL_LOST");
}

TEST_F(ControlLeaseTest, SurvivesARenewalThatDidNotGetThrough) {
  auto lease = Acquire();
  ASSERT_TRUE(lease.ok()) << lease.status();
  daemon_.Change([](FakeState& s) {
    s.refuse["RenewControl"] = grpc::Status(grpc::StatusCode::UNAVAILABLE, "Socket closed");
  });
  int tries = static_cast<int>(daemon_.Calls().size());
  ASSERT_TRUE(daemon_.Eventually(
      [&](const FakeState& s) { return static_cast<int>(s.calls.size()) > tries; }));
  daemon_.Change([](FakeState& s) { s.refuse.clear(); });
  ASSERT_TRUE(daemon_.Eventually([](const FakeState& s) { return s.renewals >= 2; }));
  EXPECT_TRUE((*lease)->status().ok());
  EXPECT_EQ(lost_, 0);
}

TEST_F(ControlLeaseTest, RefusesAHeartbeatThatCannotBeKept) {
  daemon_.Change([](FakeState& s) { s.heartbeat_seconds = 0; });
  EXPECT_EQ(ErrorReason(Acquire().status()), "HEARTBEAT_INVALID");
}

TEST_F(ControlLeaseTest, EndsInTimeWhenTheDaemonIsGone) {
  auto lease = Acquire();
  ASSERT_TRUE(lease.ok()) << lease.status();
  daemon_.Stop();
  TimePoint start = clock_.Now();
  lease->reset();
  EXPECT_LT(clock_.Now() - start, seconds(15));
}

TEST_F(ControlLeaseTest, IsGivenBackAfterCancel) {
  auto lease = Acquire();
  ASSERT_TRUE(lease.ok()) << lease.status();
  canceller_.Cancel();
  EXPECT_TRUE((*lease)->Release().ok());
  EXPECT_EQ(daemon_.Snapshot().holder, "");
}

}  // namespace
}  // namespace lightstage::client
