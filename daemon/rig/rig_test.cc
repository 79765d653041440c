#include "daemon/rig/rig.h"

#include <cmath>
#include <functional>

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
  void Dark(TimePoint deadline, Completion<LampsState> done) override {
    if (silent) {
      clock_.At(deadline, [d = std::move(done)]() mutable {
        std::move(d)(Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT", "no answer"));
      });
      return;
    }
    std::move(done)(LampsState{std::vector<float>(40, 0.0f)});
  }
  absl::Status SetTimeToDark(Duration time) override {
    time_to_dark = time;
    return absl::OkStatus();
  }
  absl::Status Refresh() override {
    if (unplugged) return absl::UnavailableError("unplugged");
    longest_gap = std::max(longest_gap, clock_.Now() - last_);
    last_ = clock_.Now();
    ++refreshes;
    return absl::OkStatus();
  }
  Duration time_to_dark{}, longest_gap{};
  int refreshes = 0;
  bool silent = false, unplugged = false;

 private:
  Clock& clock_;
  LampsInfo info_;
  TimePoint last_{};
};

// Homes in 10 ms and tells when it was stopped.
class HomingAxis final : public Axis {
 public:
  explicit HomingAxis(Clock& clock)
      : clock_(clock), null_(TestAxisInfo("turntable", true, 0, 360)) {}
  const AxisInfo& info() const override { return null_.info(); }
  void Home(TimePoint deadline, Completion<AxisState> done) override {
    if (on_home) on_home();
    clock_.At(
        clock_.Now() + std::chrono::milliseconds(10),
        [this, deadline, d = std::move(done)]() mutable { null_.Home(deadline, std::move(d)); });
  }
  void Move(Angle target, double velocity, TimePoint t, Completion<AxisState> done) override {
    null_.Move(target, velocity, t, std::move(done));
  }
  void Turn(double velocity, TimePoint t, Completion<AxisState> done) override {
    null_.Turn(velocity, t, std::move(done));
  }
  void Read(TimePoint t, Completion<AxisState> done) override { null_.Read(t, std::move(done)); }
  void Stop(TimePoint t, Completion<AxisState> done) override {
    stopped_at = clock_.Now();
    if (!stop_error.ok()) return std::move(done)(stop_error);
    null_.Stop(t, std::move(done));
  }
  std::function<void()> on_home;
  absl::Status stop_error;
  TimePoint stopped_at{};

 private:
  Clock& clock_;
  NullAxis null_;
};

class RigTest : public testing::Test {
 protected:
  TimedLamps* UseTimedLamps() {
    auto lamps = std::make_unique<TimedLamps>(clock_);
    TimedLamps* timed = lamps.get();
    file_->lamps = TableOf<Lamps>(std::move(lamps));
    return timed;
  }
  HomingAxis* UseHomingAxis() {
    auto axis = std::make_unique<HomingAxis>(clock_);
    HomingAxis* homing = axis.get();
    file_->turntable = TableOf<Axis>(std::move(axis));
    return homing;
  }
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
  TimedLamps* timed = UseTimedLamps();
  Open();
  EXPECT_EQ(timed->time_to_dark, std::chrono::seconds(3)) << "what a rig file that is silent gets";
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

TEST_F(RigTest, LampsThatWentDarkByThemselvesAreUnknownAndADisturbance) {
  TimedLamps* timed = UseTimedLamps();
  Open();
  Condition light{{{0, 1.0}}, {}};
  ASSERT_TRUE(rig_->StartCondition(light)->Wait().ok());
  uint64_t before = rig_->disturbances();
  timed->unplugged = true;
  SleepFor(clock_, std::chrono::seconds(2));
  EXPECT_TRUE(rig_->CheckUndisturbed(before).ok()) << "a missed refresh is not the end yet";
  SleepFor(clock_, std::chrono::seconds(2));
  EXPECT_EQ(ErrorReason(rig_->CheckUndisturbed(before)), "RIG_DISTURBED");
  EXPECT_TRUE(std::isnan(rig_->Snapshot(false).lamp_levels[0]));
  // The next shot under the same light must command it again.
  timed->unplugged = false;
  int then = timed->refreshes;
  ASSERT_TRUE(rig_->StartCondition(light)->Wait().ok());
  EXPECT_EQ(timed->refreshes, then + 1);
  EXPECT_EQ(rig_->Snapshot(false).lamp_levels[0], 1.0f);
}

TEST_F(RigTest, AHomingThatNobodyWaitsForIsStopped) {
  HomingAxis* axis = UseHomingAxis();
  Open();
  for (bool jog : {false, true}) {
    SleepFor(clock_, std::chrono::milliseconds(1));
    axis->stopped_at = {};
    const auto gone = [] { return true; };
    const absl::Status moved =
        jog ? rig_->JogAxis(AxisId::kTurntable, 5, std::chrono::seconds(1), gone).status()
            : rig_->MoveAxis(AxisId::kTurntable, Degrees(30), 0, gone).status();
    EXPECT_EQ(ErrorReason(moved), "STOPPED") << moved;
    EXPECT_NE(axis->stopped_at, TimePoint{});
  }
}

TEST_F(RigTest, SilentLampsDoNotDelayTheAxisStop) {
  TimedLamps* lamps = UseTimedLamps();
  HomingAxis* axis = UseHomingAxis();
  Open();
  lamps->silent = true;
  TimePoint asked = clock_.Now();
  absl::Status stopped = rig_->Stop(Error(absl::StatusCode::kAborted, "STOP_ASKED", "smoke"));
  EXPECT_THAT(MessageOf(stopped), testing::HasSubstr("lamps"));
  EXPECT_EQ(axis->stopped_at, asked);
  EXPECT_GT(clock_.Now(), asked);
  lamps->silent = false;
}

// Until it is homed, an axis whose link was lost confirms no stop.
TEST_F(RigTest, ResetHomesAnAxisThatCannotBeStopped) {
  HomingAxis* axis = UseHomingAxis();
  Open();
  axis->stop_error = Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "went away");
  EXPECT_EQ(ErrorReason(rig_->Stop(Error(absl::StatusCode::kAborted, "STOP_ASKED", "smoke"))),
            "DEVICE_LOST");
  bool homed = false;
  axis->on_home = [&] { homed = true; };
  EXPECT_TRUE(rig_->Reset().ok());
  EXPECT_TRUE(homed);
}

TEST_F(RigTest, AHaltDuringResetLeavesItLatched) {
  HomingAxis* axis = UseHomingAxis();
  Open();
  ASSERT_TRUE(rig_->Stop(Error(absl::StatusCode::kAborted, "STOP_ASKED", "smoke")).ok());
  axis->on_home = [this] {
    clock_.At(clock_.Now() + std::chrono::milliseconds(5), [this] {
      EXPECT_EQ(ErrorReason(rig_->Acquire(RigUse::kManual)), "RIG_STOPPED");
      EXPECT_EQ(ErrorReason(rig_->Reset()), "RIG_BUSY");
      EXPECT_TRUE(rig_->HaltManual().ok());
    });
  };
  EXPECT_EQ(ErrorReason(rig_->Reset()), "RIG_DISTURBED");
  EXPECT_EQ(ErrorReason(rig_->stop_reason()), "STOP_ASKED");
  axis->on_home = nullptr;
  ASSERT_TRUE(rig_->Reset().ok());
  EXPECT_TRUE(rig_->Acquire(RigUse::kManual).ok());
  rig_->Release();
}

TEST_F(RigTest, LostControlLeavesARunAlone) {
  Open();
  ASSERT_TRUE(rig_->Acquire(RigUse::kRun).ok());
  uint64_t before = rig_->disturbances();
  ASSERT_TRUE(rig_->StartCondition({{{0, 1.0}}, {}})->Wait().ok());
  ASSERT_TRUE(rig_->HaltManual().ok());
  EXPECT_TRUE(rig_->CheckUndisturbed(before).ok());
  EXPECT_EQ(rig_->Snapshot(false).lamp_levels[0], 1.0f);
  rig_->Release();
  ASSERT_TRUE(rig_->HaltManual().ok());
  EXPECT_EQ(rig_->Snapshot(false).lamp_levels[0], 0.0f);
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
