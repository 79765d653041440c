#include "client/cpp/watch_run.h"

#include <thread>
#include <vector>

#include "client/cpp/testing/fake_daemon.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::ElementsAre;

class WatchRunTest : public ::testing::Test {
 protected:
  void SetUp() override {
    daemon_.Change([](FakeState& s) {
      s.runs["runs/a"].set_name("runs/a");
      s.runs["runs/a"].set_state(v1::RUN_STATE_RUNNING);
    });
    auto connection = Connect(daemon_.address(), clock_, canceller_);
    ASSERT_TRUE(connection.ok()) << connection.status();
    connection_ = *std::move(connection);
  }

  void AddShots(int count) {
    daemon_.Change([&](FakeState& s) {
      auto& shots = s.shots["runs/a"];
      for (int i = 0; i < count; ++i) shots.emplace_back().set_id(next_shot_++);
      s.runs["runs/a"].set_done_shots(static_cast<int>(shots.size()));
    });
  }
  void End(v1::RunState state) {
    daemon_.Change([&](FakeState& s) { s.runs["runs/a"].set_state(state); });
  }

  absl::StatusOr<v1::Run> Watch(std::optional<int> shots_from = 0,
                                Duration patience = seconds(20)) {
    WatchOptions options;
    options.shots_from = shots_from;
    options.patience = patience;
    options.on_break = [this](const absl::Status&) { ++breaks_; };
    return WatchRun(*connection_, "runs/a", std::move(options), canceller_,
                    [this](const v1::WatchRunResponse& response) {
                      for (const auto& shot : response.shots()) seen_.push_back(shot.id());
                      states_.push_back(response.run().state());
                      return states_.back() != stop_at_;
                    });
  }

  FakeDaemon daemon_;
  RealClock clock_;
  Canceller canceller_{clock_};
  std::unique_ptr<Connection> connection_;
  int64_t next_shot_ = 0;
  std::vector<int64_t> seen_;
  std::vector<v1::RunState> states_;
  v1::RunState stop_at_ = v1::RUN_STATE_UNSPECIFIED;
  int breaks_ = 0;
};

TEST_F(WatchRunTest, EndsWithTheRun) {
  AddShots(3);
  End(v1::RUN_STATE_SUCCEEDED);
  auto run = Watch();
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_EQ(run->state(), v1::RUN_STATE_SUCCEEDED);
  EXPECT_THAT(seen_, ElementsAre(0, 1, 2));
}

TEST_F(WatchRunTest, SendsNoShotsUnlessAsked) {
  AddShots(3);
  End(v1::RUN_STATE_FAILED);
  auto run = Watch(std::nullopt);
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_THAT(seen_, ElementsAre());
  EXPECT_FALSE(daemon_.Last<v1::WatchRunRequest>("WatchRun").has_shots_from());
}

// The stream breaks in the middle, twice in different ways; every shot is seen exactly once all the
// same.
TEST_F(WatchRunTest, ContinuesAtTheNextShotWhenTheStreamBreaks) {
  AddShots(3);
  daemon_.Change([](FakeState& s) { s.answers_before_break = 1; });
  std::thread rig([&] {
    daemon_.Eventually([](const FakeState& s) { return s.answers_before_break == 0; });
    AddShots(2);  // breaks instead of being sent
    daemon_.Eventually([](const FakeState& s) { return s.calls.size() == 2; });
    daemon_.Change([](FakeState& s) {
      s.break_in_order = true;
      s.answers_before_break = 1;
    });
    daemon_.Eventually([](const FakeState& s) { return s.answers_before_break == 0; });
    AddShots(4);
    daemon_.Eventually([](const FakeState& s) { return s.calls.size() == 3; });
    End(v1::RUN_STATE_SUCCEEDED);
  });
  auto run = Watch();
  rig.join();
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_THAT(seen_, ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8));
  EXPECT_EQ(breaks_, 2);
}

TEST_F(WatchRunTest, SurvivesARestartOfTheDaemon) {
  AddShots(2);
  std::thread rig([&] {
    daemon_.Eventually([](const FakeState& s) { return !s.calls.empty(); });
    SleepFor(clock_, milliseconds(100));
    daemon_.Stop();
    SleepFor(clock_, milliseconds(300));
    AddShots(1);
    End(v1::RUN_STATE_INTERRUPTED);
    daemon_.Start();
  });
  auto run = Watch();
  rig.join();
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_EQ(run->state(), v1::RUN_STATE_INTERRUPTED);
  EXPECT_THAT(seen_, ElementsAre(0, 1, 2));
  EXPECT_GE(breaks_, 1);
}

TEST_F(WatchRunTest, GivesUpWhenTheDaemonStaysAway) {
  std::thread rig([&] {
    daemon_.Eventually([](const FakeState& s) { return !s.calls.empty(); });
    daemon_.Stop();
  });
  auto run = Watch(0, milliseconds(500));
  rig.join();
  EXPECT_EQ(ErrorReason(run.status()), kCannotConnect) << run.status();
}

TEST_F(WatchRunTest, TheDaemonsErrorsAreNotRetried) {
  daemon_.Change([](FakeState& s) { s.runs.clear(); });
  auto run = Watch();
  EXPECT_EQ(ErrorReason(run.status()), "RUN_NOT_FOUND");
  EXPECT_EQ(daemon_.Calls().size(), 1u);
}

TEST_F(WatchRunTest, StopsWhenTheCallbackSaysSo) {
  stop_at_ = v1::RUN_STATE_PAUSED;
  End(v1::RUN_STATE_PAUSED);
  auto run = Watch();
  ASSERT_TRUE(run.ok()) << run.status();
  EXPECT_EQ(run->state(), v1::RUN_STATE_PAUSED);
}

TEST_F(WatchRunTest, CancelEndsItAlsoWhileTheDaemonIsAway) {
  daemon_.Change([](FakeState& s) { s.answers_before_break = 0; });
  std::thread user([&] {
    daemon_.Eventually([](const FakeState& s) { return !s.calls.empty(); });
    daemon_.Stop();
    SleepFor(clock_, milliseconds(200));
    canceller_.Cancel();
  });
  auto run = Watch(0, seconds(60));
  user.join();
  EXPECT_EQ(ErrorReason(run.status()), kCancelled);
}

}  // namespace
}  // namespace lightstage::client
