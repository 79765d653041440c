#include "client/cpp/connection.h"

#include <atomic>
#include <thread>

#include "client/cpp/testing/fake_daemon.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class ConnectionTest : public ::testing::Test {
 protected:
  std::string ConnectReason(const std::string& address) {
    auto connection = Connect(address, clock_, canceller_);
    return connection.ok() ? "OK" : ErrorReason(connection.status());
  }

  RealClock clock_;
  Canceller canceller_{clock_};
};

TEST_F(ConnectionTest, RefusesUnreadableAddresses) {
  for (const char* address : {"", "lab3", "lab3:", "lab3:0", "lab3:65536", "lab3:http", ":7420",
                              "unix:", "::1:7420", "http://lab3:7420"}) {
    EXPECT_EQ(ConnectReason(address), "ADDRESS_INVALID") << address;
  }
  EXPECT_EQ(ConnectReason("unix:/" + std::string(120, 'x')), "ADDRESS_INVALID");
}

TEST_F(ConnectionTest, ARefusalEndsTheWaitBeforeItsDeadline) {
  EXPECT_EQ(ConnectReason("unix:/nonexistent/lightstaged.sock"), kCannotConnect);
  EXPECT_EQ(ConnectReason("127.0.0.1:1"), kCannotConnect);
  Connection connection(
      "nobody", grpc::CreateChannel("unix:/nonexistent/socket", grpc::InsecureChannelCredentials()),
      clock_);
  TimePoint deadline = clock_.Now() + seconds(60);
  EXPECT_EQ(ErrorReason(connection.WaitReady(deadline, /*patient=*/false, canceller_)),
            kCannotConnect);
  EXPECT_LT(clock_.Now(), deadline - seconds(30));
}

TEST_F(ConnectionTest, ADefaultAddressComesFromTheEnvironment) {
  setenv("LIGHTSTAGE_ADDRESS", "lab3:99", 1);
  EXPECT_EQ(DefaultAddress(), "lab3:99");
  setenv("LIGHTSTAGE_ADDRESS", "", 1);
  EXPECT_EQ(DefaultAddress(), "127.0.0.1:7420");
  unsetenv("LIGHTSTAGE_ADDRESS");
  EXPECT_EQ(DefaultAddress(), "127.0.0.1:7420");
}

TEST_F(ConnectionTest, AProxyForTheWebIsNotAsked) {
  setenv("http_proxy", "http://127.0.0.1:1", 1);
  FakeDaemon daemon;
  auto connection = Connect(daemon.address(), clock_, canceller_);
  unsetenv("http_proxy");
  EXPECT_TRUE(connection.ok()) << connection.status();
}

TEST_F(ConnectionTest, WaitsForADaemonThatIsStarting) {
  FakeDaemon daemon;
  daemon.Stop();
  std::thread starter([&] {
    SleepFor(clock_, milliseconds(300));
    daemon.Start();
  });
  auto connection = Connect(daemon.address(), clock_, canceller_, seconds(20));
  starter.join();
  EXPECT_TRUE(connection.ok()) << connection.status();
}

TEST_F(ConnectionTest, CancelEndsTheWaitForADaemon) {
  std::thread canceller([&] {
    SleepFor(clock_, milliseconds(100));
    canceller_.Cancel();
  });
  auto connection = Connect("127.0.0.1:1", clock_, canceller_, seconds(60));
  canceller.join();
  EXPECT_EQ(ErrorReason(connection.status()), kCancelled);
}

TEST_F(ConnectionTest, CallsCarryTheDaemonsErrors) {
  FakeDaemon daemon;
  daemon.Change([](FakeState& s) { s.rig.set_display_name("Lab 3"); });
  auto connection = Connect(daemon.address(), clock_, canceller_);
  ASSERT_TRUE(connection.ok()) << connection.status();
  auto rig = Call((*connection)->rig(), &v1::RigService::Stub::GetRig, {}, canceller_);
  ASSERT_TRUE(rig.ok()) << rig.status();
  EXPECT_EQ(rig->rig().display_name(), "Lab 3");
  v1::GetRunRequest request;
  request.set_name("runs/none");
  auto run = Call((*connection)->runs(), &v1::RunService::Stub::GetRun, request, canceller_);
  EXPECT_EQ(ErrorReason(run.status()), "RUN_NOT_FOUND");
}

TEST_F(ConnectionTest, ADaemonThatWentAwayIsALostConnection) {
  FakeDaemon daemon;
  auto connection = Connect(daemon.address(), clock_, canceller_);
  ASSERT_TRUE(connection.ok()) << connection.status();
  daemon.Stop();
  auto rig = Call((*connection)->rig(), &v1::RigService::Stub::GetRig, {}, canceller_);
  EXPECT_TRUE(IsConnectionLost(rig.status())) << rig.status();
}

TEST_F(ConnectionTest, CancelEndsACallInProgressAndOnesThatFollow) {
  FakeDaemon daemon;
  daemon.Change([](FakeState& s) { s.runs["runs/a"].set_state(v1::RUN_STATE_RUNNING); });
  auto connection = Connect(daemon.address(), clock_, canceller_);
  ASSERT_TRUE(connection.ok()) << connection.status();
  v1::WatchRunRequest request;
  request.set_name("runs/a");
  std::atomic<int> answers = 0;
  std::thread canceller([&] {
    clock_.WaitUntil(clock_.Now() + seconds(10), [&] { return answers > 0; });
    canceller_.Cancel();
  });
  absl::Status status = ReadStream((*connection)->runs(), &v1::RunService::Stub::WatchRun, request,
                                   canceller_, [&](const v1::WatchRunResponse&) {
                                     ++answers;
                                     clock_.Notify();
                                     return true;
                                   });
  canceller.join();
  EXPECT_EQ(answers, 1);
  EXPECT_EQ(ErrorReason(status), kCancelled);
  auto rig = Call((*connection)->rig(), &v1::RigService::Stub::GetRig, {}, canceller_);
  EXPECT_EQ(ErrorReason(rig.status()), kCancelled);
}

}  // namespace
}  // namespace lightstage::client
