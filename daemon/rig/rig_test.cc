#include "daemon/rig/rig.h"

#include <atomic>

#include "daemon/rig/testing/null_rig.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

// Lamps that go dark by themselves as the contract says, and remember it.
class TimedLamps final : public Lamps {
 public:
  explicit TimedLamps(Clock& clock) : clock_(clock) {
    info_.count = 40;
    info_.max_time_to_dark = std::chrono::seconds(10);
  }
  const LampsInfo& info() const override { return info_; }
  void Set(const std::vector<float>& levels, TimePoint, Completion<LampsState> done) override {
    (void)Refresh();
    std::move(done)(LampsState{levels});
  }
  void Dark(TimePoint, Completion<LampsState> done) override {
    std::move(done)(LampsState{std::vector<float>(40, 0.0f)});
  }
  absl::Status SetTimeToDark(Duration time) override {
    time_to_dark = time;
    return absl::OkStatus();
  }
  absl::Status Refresh() override {
    longest_gap = std::max(longest_gap, clock_.Now() - last_);
    last_ = clock_.Now();
    ++refreshes;
    return absl::OkStatus();
  }
  Duration time_to_dark{}, longest_gap{};
  int refreshes = 0;

 private:
  Clock& clock_;
  LampsInfo info_;
  TimePoint last_{};
};

class RigTest : public testing::Test {
 protected:
  void Open() {
    auto rig = Rig::Open(*file_, clock_);
    ASSERT_TRUE(rig.ok()) << rig.status();
    rig_ = *std::move(rig);
  }
  VirtualClock clock_;
  std::unique_ptr<RigFile> file_ = NullRigFile(clock_);
  std::unique_ptr<Rig> rig_;
};

TEST_F(RigTest, OneUserAtATime) {
  Open();
  ASSERT_TRUE(rig_->Acquire(RigUse::kRun).ok());
  EXPECT_EQ(ErrorReason(rig_->Acquire(RigUse::kManual)), "RUN_ACTIVE");
  rig_->Release();
  ASSERT_TRUE(rig_->Acquire(RigUse::kManual).ok());
  EXPECT_EQ(ErrorReason(rig_->Acquire(RigUse::kRun)), "RIG_BUSY");
  rig_->Release();
}

TEST_F(RigTest, AStoppedRigRefusesEverythingUntilReset) {
  Open();
  ASSERT_TRUE(rig_->Stop(Error(absl::StatusCode::kAborted, "STOP_ASKED", "smoke")).ok());
  auto never = [] { return false; };
  EXPECT_EQ(ErrorReason(rig_->Acquire(RigUse::kRun)), "RIG_STOPPED");
  EXPECT_EQ(ErrorReason(rig_->StartCondition({{{3, 1.0}}, {}})->Wait()), "RIG_STOPPED");
  EXPECT_EQ(ErrorReason(rig_->StartPose({Degrees(9), Degrees(9)})->Wait()), "RIG_STOPPED");
  EXPECT_EQ(ErrorReason(rig_->MoveAxis(AxisId::kTilt, Degrees(9), 0, never).status()),
            "RIG_STOPPED");
  EXPECT_EQ(ErrorReason(rig_->HomeAll()), "RIG_STOPPED");
  EXPECT_THAT(MessageOf(rig_->Acquire(RigUse::kRun)), testing::HasSubstr("smoke"));
  // A later stop does not hide why it was stopped first.
  ASSERT_TRUE(rig_->Stop(Error(absl::StatusCode::kAborted, "STOP_ASKED", "again")).ok());
  EXPECT_THAT(MessageOf(rig_->CheckRunning()), testing::HasSubstr("smoke"));
  ASSERT_TRUE(rig_->Reset().ok());
  EXPECT_TRUE(rig_->StartPose({Degrees(9), Degrees(9)})->Wait().ok());
}

TEST_F(RigTest, SnapshotTellsWhatWasConfirmed) {
  Open();
  ASSERT_TRUE(rig_->StartPose({Degrees(30), Degrees(45)})->Wait().ok());
  Pattern full{.arrangement = PatternArrangement::kFull};
  ASSERT_TRUE(rig_->StartCondition({{{7, 0.5}}, full})->Wait().ok());
  RigSnapshot snapshot = rig_->Snapshot(true);
  ASSERT_EQ(snapshot.axes.size(), 2u);
  EXPECT_EQ(snapshot.axes[0].state.position, Degrees(30));
  EXPECT_EQ(snapshot.axes[1].state.position, Degrees(45));
  EXPECT_FLOAT_EQ(snapshot.lamp_levels[7], 0.5f);
  EXPECT_EQ(snapshot.pattern, full);
  ASSERT_TRUE(rig_->Dark().ok());
  snapshot = rig_->Snapshot(false);
  EXPECT_THAT(snapshot.lamp_levels, testing::Each(0.0f));
  EXPECT_EQ(snapshot.pattern, Pattern{});
}

TEST_F(RigTest, LampsAreRefreshedWhileLitAndOnlyThen) {
  file_->engine.lamp_time_to_dark = std::chrono::seconds(3);
  auto lamps = std::make_unique<TimedLamps>(clock_);
  TimedLamps* timed = lamps.get();
  file_->lamps = TableOf<Lamps>(std::move(lamps));
  Open();
  EXPECT_EQ(timed->time_to_dark, std::chrono::seconds(3));
  ASSERT_TRUE(rig_->StartCondition({{{0, 1.0}}, {}})->Wait().ok());
  timed->longest_gap = {};
  SleepFor(clock_, std::chrono::seconds(60));
  EXPECT_LE(timed->longest_gap, std::chrono::seconds(1));
  EXPECT_GE(timed->refreshes, 60);
  ASSERT_TRUE(rig_->Dark().ok());
  SleepFor(clock_, std::chrono::seconds(2));
  int then = timed->refreshes;
  SleepFor(clock_, std::chrono::seconds(60));
  EXPECT_EQ(timed->refreshes, then);
}

TEST_F(RigTest, MissingDevicesAreNamed) {
  file_->projector = {};
  file_->tilt = {};
  Open();
  Pattern full{.arrangement = PatternArrangement::kFull};
  EXPECT_EQ(ErrorReason(rig_->StartCondition({{}, full})->Wait()), "DEVICE_MISSING");
  EXPECT_EQ(ErrorReason(rig_->StartPose({Degrees(0), Degrees(10)})->Wait()), "DEVICE_MISSING");
  EXPECT_TRUE(rig_->StartPose({Degrees(10), Degrees(0)})->Wait().ok());
}

TEST_F(RigTest, ACameraThatCannotDoWhatTheFileSaysIsRefused) {
  file_->camera_options.config.width = 9999;
  auto rig = Rig::Open(*file_, clock_);
  ASSERT_FALSE(rig.ok());
  EXPECT_EQ(ErrorReason(rig.status()), "CAMERA_CONFIG");
  EXPECT_THAT(MessageOf(rig.status()), testing::HasSubstr("9999"));
}

}  // namespace
}  // namespace lightstage
