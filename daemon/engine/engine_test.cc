#include "daemon/engine/engine.h"

#include <atomic>
#include <cmath>
#include <functional>
#include <set>
#include <thread>

#include "daemon/engine/facts.h"
#include "daemon/rig/testing/null_rig.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;

// What happened, with the rig's time.
class Log {
 public:
  void Add(Clock& clock, std::string what) {
    MutexLock lock(&mutex_);
    entries_.emplace_back(Seconds(clock.Now().time_since_epoch()), std::move(what));
  }
  std::vector<std::pair<double, std::string>> entries() const {
    MutexLock lock(&mutex_);
    return entries_;
  }
  // Time of the nth entry (from 0) that is `what`; −1 if there is none.
  double At(const std::string& what, int n = 0) const {
    for (const auto& [time, entry] : entries())
      if (entry == what && n-- == 0) return time;
    return -1;
  }

 private:
  mutable Mutex mutex_;
  std::vector<std::pair<double, std::string>> entries_ ABSL_GUARDED_BY(mutex_);
};

// A camera that needs time on the clock and fails as told.
class ScriptedCamera final : public Camera {
 public:
  ScriptedCamera(Clock& clock, Log& log) : clock_(clock), log_(log), null_(clock, 8, 6) {
    info_ = null_.info();
    info_.readout = milliseconds(20);
  }
  const CameraInfo& info() const override { return info_; }
  ConfigResult Validate(const CameraConfig& c) const override { return null_.Validate(c); }
  ExposureResult ValidateExposure(Duration d) const override { return null_.ValidateExposure(d); }
  void Configure(const CameraConfig& c, TimePoint t, Completion<CameraConfig> d) override {
    log_.Add(clock_, "configure");
    null_.Configure(c, t, std::move(d));
  }
  void Arm(TimePoint t, Completion<CameraConfig> d) override { null_.Arm(t, std::move(d)); }
  void Disarm(TimePoint t, Completion<CameraConfig> d) override { null_.Disarm(t, std::move(d)); }
  void Trigger(Duration exposure, TimePoint deadline, Completion<ExposureEnd> ended,
               Completion<Frame> ready) override {
    int number = ++triggers_;
    log_.Add(clock_, "trigger");
    if (on_trigger) on_trigger(number);
    if (silent.count(number)) {
      clock_.At(deadline, [e = std::move(ended), r = std::move(ready)]() mutable {
        absl::Status silent = Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT", "silent");
        std::move(e)(silent);
        std::move(r)(silent);
      });
      return;
    }
    TimePoint end = clock_.Now() + exposure;
    clock_.At(end, [this, e = std::move(ended)]() mutable {
      log_.Add(clock_, "exposure ended");
      std::move(e)(ExposureEnd{clock_.Now()});
    });
    clock_.At(end + info_.readout, [this, number, exposure, r = std::move(ready)]() mutable {
      log_.Add(clock_, "frame");
      if (incomplete.count(number) || (all_incomplete && number >= all_incomplete)) {
        std::move(r)(Error(absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE", "3 packets lost"));
        return;
      }
      Frame frame;
      frame.width = 8;
      frame.height = 6;
      frame.data.resize(48);
      frame.exposure = exposure;
      frame.sequence = number;
      std::move(r)(std::move(frame));
    });
  }

  std::function<void(int)> on_trigger;
  std::set<int> silent, incomplete;    // by trigger number, from 1
  std::atomic<int> all_incomplete{0};  // from this trigger on

 private:
  Clock& clock_;
  Log& log_;
  NullCamera null_;
  CameraInfo info_;
  int triggers_ = 0;
};

// Lamps that are at their level 5 ms after the command.
class SlowLamps final : public Lamps {
 public:
  SlowLamps(Clock& clock, Log& log) : clock_(clock), log_(log) {
    info_.count = 40;
    info_.settle = milliseconds(5);
  }
  const LampsInfo& info() const override { return info_; }
  void Set(const std::vector<float>& levels, TimePoint, Completion<LampsState> done) override {
    log_.Add(clock_, "lamps");
    lit = *std::max_element(levels.begin(), levels.end()) > 0;
    std::vector<float> confirmed = levels;
    if (steps > 0)
      for (float& level : confirmed) level = std::round(level * steps) / steps;
    if (dead >= 0) confirmed[dead] = 0;
    clock_.At(clock_.Now() + info_.settle,
              [confirmed, d = std::move(done)]() mutable { std::move(d)(LampsState{confirmed}); });
  }
  void Dark(TimePoint, Completion<LampsState> done) override {
    log_.Add(clock_, "dark");
    lit = false;
    std::move(done)(LampsState{std::vector<float>(40, 0.0f)});
  }
  void Check(TimePoint, Completion<std::monostate> done) override {
    if (lost_in_exposure > 0 && --lost_in_exposure == 0) {
      return std::move(done)(Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "went away"));
    }
    std::move(done)(std::monostate());
  }
  absl::Status SetTimeToDark(Duration) override { return absl::OkStatus(); }
  absl::Status Refresh() override { return absl::OkStatus(); }

  void SetSteps(int n) { info_.steps = steps = n; }
  std::atomic<bool> lit{false};
  int dead = -1;             // this lamp never shines
  int lost_in_exposure = 0;  // they go away in this one; 0: never
  int steps = 0;

 private:
  Clock& clock_;
  Log& log_;
  LampsInfo info_;
};

// Moves in 50 ms.
class SlowAxis final : public Axis {
 public:
  SlowAxis(Clock& clock, Log& log) : clock_(clock), log_(log) {
    info_ = TestAxisInfo("turntable", true, 0, 360);
  }
  const AxisInfo& info() const override { return info_; }
  void Home(TimePoint, Completion<AxisState> done) override {
    log_.Add(clock_, "home");
    state_ = {.homed = true};
    std::move(done)(state_);
  }
  void Move(Angle target, double, TimePoint, Completion<AxisState> done) override {
    log_.Add(clock_, "move");
    clock_.At(clock_.Now() + milliseconds(50), [this, target, d = std::move(done)]() mutable {
      log_.Add(clock_, "moved");
      state_.position = target + nudge;
      std::move(d)(state_);
    });
  }
  void Turn(double, TimePoint, Completion<AxisState> done) override { std::move(done)(state_); }
  void Read(TimePoint, Completion<AxisState> done) override { std::move(done)(state_); }
  void Stop(TimePoint, Completion<AxisState> done) override {
    log_.Add(clock_, "axis stop");
    std::move(done)(state_);
  }
  Angle nudge;
  void Shift(Angle by) { state_.position = state_.position + by; }

 private:
  Clock& clock_;
  Log& log_;
  AxisInfo info_;
  AxisState state_;
};

class ListProgram final : public Program {
 public:
  explicit ListProgram(std::vector<Step> steps) : steps_(std::move(steps)) {}
  absl::StatusOr<Step> Next(const Results& results) override {
    counts_seen.push_back(results.count());
    if (at_ == steps_.size()) return Done{};
    return steps_[at_++];
  }
  std::vector<uint64_t> counts_seen;

 private:
  std::vector<Step> steps_;
  size_t at_ = 0;
};

Shot ShotOf(uint64_t id, double azimuth, int lamp) {
  Shot shot;
  shot.id = id;
  shot.pose.azimuth = Degrees(azimuth);
  shot.condition.lamps = {{lamp, 1.0}};
  shot.exposures = {milliseconds(10)};
  return shot;
}

std::vector<Step> Shots(int count) {
  std::vector<Step> steps;
  for (int i = 0; i < count; ++i) steps.push_back(ShotOf(i, 10.0 * (i / 4 % 36), i % 4));
  return steps;
}

class EngineTest : public testing::Test, public ShotSink, public Results {
 protected:
  void Open() {
    file_ = NullRigFile(clock_);
    auto camera = std::make_unique<ScriptedCamera>(clock_, log_);
    camera_ = camera.get();
    auto lamps = std::make_unique<SlowLamps>(clock_, log_);
    lamps_ = lamps.get();
    auto table = std::make_unique<SlowAxis>(clock_, log_);
    table_ = table.get();
    file_->camera = TableOf<Camera>(std::move(camera));
    file_->lamps = TableOf<Lamps>(std::move(lamps));
    file_->turntable = TableOf<Axis>(std::move(table));
    auto rig = Rig::Open(*file_, clock_);
    ASSERT_TRUE(rig.ok()) << rig.status();
    rig_ = *std::move(rig);
    facts_ = FactsOf(*rig_);
  }

  void Start(std::vector<Step> steps, std::set<uint64_t> done = {},
             std::optional<Engine::Resumption> resumption = {}) {
    program_ = std::make_unique<ListProgram>(std::move(steps));
    Engine::Hooks hooks;
    hooks.state_changed = [this](RunState state, const absl::Status& reason) {
      MutexLock lock(&mutex_);
      states_.push_back(state);
      reason_ = reason;
      lit_at_state_.push_back(lamps_->lit);
      changed_.SignalAll();
    };
    hooks.finish = [this] { return finish_; };
    engine_ = std::make_unique<Engine>(
        *rig_, facts_, *program_, *this, [done](uint64_t id) { return done.count(id) > 0; },
        std::move(resumption), hooks);
    ASSERT_TRUE(rig_->Acquire(RigUse::kRun).ok());
    thread_ = std::thread([this] {
      end_ = engine_->Run(*this);
      rig_->Release();
    });
  }
  // Waits in real time for the nth state report; the run's own time is virtual.
  RunState WaitState(size_t n) {
    MutexLock lock(&mutex_);
    while (states_.size() < n) {
      if (changed_.WaitFor(&mutex_, std::chrono::seconds(30))) {
        ADD_FAILURE() << "state " << n << " never came";
        return RunState::kFailed;
      }
    }
    RunState state = states_[n - 1];
    // It is reported to be kept, and can be acted upon a moment later.
    while (states_.size() == n && engine_->progress().state != state)
      changed_.WaitFor(&mutex_, milliseconds(1));
    return state;
  }
  RunState Join() {
    thread_.join();
    return end_;
  }
  void TearDown() override {
    if (thread_.joinable()) {
      engine_->Interrupt();
      thread_.join();
    }
  }

  // ShotSink
  void Put(RawShot shot, std::chrono::nanoseconds, absl::FunctionRef<void()> stalled) override {
    if (stalls_.erase(shot.shot.id)) {
      stalled();
      EXPECT_FALSE(lamps_->lit) << "while the store does not take shot " << shot.shot.id;
    }
    absl::Status stored;
    {
      MutexLock lock(&mutex_);
      if (refuse_once_.erase(shot.shot.id)) {
        stored = Error(absl::StatusCode::kResourceExhausted, "DISK_FULL", "no space left");
      } else {
        ids_.push_back(shot.shot.id);
        levels_.push_back(shot.shot.condition.lamps.at(0).level);
        attempts_.push_back(shot.attempt);
        frames_ += shot.frames.size();
      }
    }
    engine_->OnOutcome(shot.shot.id, stored);
  }
  void Drain() override {}
  // Results
  uint64_t count() const override {
    MutexLock lock(&mutex_);
    return ids_.size();
  }
  absl::StatusOr<ShotRecord> Find(uint64_t) const override { return ShotRecord{}; }

  std::vector<uint64_t> ids() {
    MutexLock lock(&mutex_);
    return ids_;
  }
  absl::Status reason() {
    MutexLock lock(&mutex_);
    return reason_;
  }

  VirtualClock clock_;
  Log log_;
  std::unique_ptr<RigFile> file_;
  ScriptedCamera* camera_ = nullptr;
  SlowLamps* lamps_ = nullptr;
  SlowAxis* table_ = nullptr;
  std::unique_ptr<Rig> rig_;
  RigFacts facts_;
  std::unique_ptr<ListProgram> program_;
  std::unique_ptr<Engine> engine_;
  std::thread thread_;
  RunState end_ = RunState::kFailed;
  absl::Status finish_;

  mutable Mutex mutex_;
  CondVar changed_;
  std::vector<RunState> states_ ABSL_GUARDED_BY(mutex_);
  std::vector<bool> lit_at_state_ ABSL_GUARDED_BY(mutex_);
  absl::Status reason_ ABSL_GUARDED_BY(mutex_);
  std::vector<uint64_t> ids_ ABSL_GUARDED_BY(mutex_);
  std::vector<int> attempts_ ABSL_GUARDED_BY(mutex_);
  std::vector<double> levels_ ABSL_GUARDED_BY(mutex_);
  std::set<uint64_t> stalls_;  // the engine's thread only
  size_t frames_ ABSL_GUARDED_BY(mutex_) = 0;
  std::set<uint64_t> refuse_once_ ABSL_GUARDED_BY(mutex_);
};

TEST_F(EngineTest, TakesEveryShotInOrderAndEndsDark) {
  Open();
  Start(Shots(12));
  EXPECT_EQ(Join(), RunState::kSucceeded);
  EXPECT_THAT(ids(), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11));
  EXPECT_FALSE(lamps_->lit);
  EXPECT_EQ(rig_->use(), RigUse::kNone);
}

TEST_F(EngineTest, MotionAndLightStartWhenTheExposureEndsNotWhenTheFrameIsHere) {
  Open();
  Start({ShotOf(0, 10, 0), ShotOf(1, 20, 1)});
  ASSERT_EQ(Join(), RunState::kSucceeded);
  double ended = log_.At("exposure ended", 0);
  EXPECT_DOUBLE_EQ(log_.At("move", 1), ended);
  EXPECT_DOUBLE_EQ(log_.At("lamps", 1), ended);
  EXPECT_DOUBLE_EQ(log_.At("frame", 0), ended + 0.020);
  // The next exposure waits for the slowest, the move of 50 ms.
  EXPECT_DOUBLE_EQ(log_.At("trigger", 1), ended + 0.050);
}

TEST_F(EngineTest, NothingChangesDuringAnExposure) {
  Open();
  Start(Shots(8));
  ASSERT_EQ(Join(), RunState::kSucceeded);
  bool exposing = false;
  for (const auto& [time, what] : log_.entries()) {
    if (what == "trigger") exposing = true;
    if (what == "exposure ended") exposing = false;
    EXPECT_FALSE(exposing && (what == "move" || what == "lamps" || what == "dark"))
        << what << " " << time;
  }
}

TEST_F(EngineTest, ALostFrameIsRetaken) {
  Open();
  camera_->incomplete = {3};
  Start(Shots(6));
  ASSERT_EQ(Join(), RunState::kSucceeded);
  auto taken = ids();
  std::sort(taken.begin(), taken.end());
  EXPECT_THAT(taken, ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_EQ(engine_->progress().retakes, 1u);
  MutexLock lock(&mutex_);
  EXPECT_THAT(attempts_, testing::Contains(2).Times(1));
}

TEST_F(EngineTest, TheReasonOfAPauseKeepsTheFirstFailure) {
  Open();
  camera_->incomplete = {3};  // shot 2; found out while shot 3 is taken
  camera_->silent = {5, 6};   // shot 2 again, twice
  Start(Shots(6));
  EXPECT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "DEVICE_SILENT");
  EXPECT_THAT(MessageOf(reason()),
              testing::HasSubstr("shot 2, attempt 3 (the first failed with: 3 packets lost): "));
}

TEST_F(EngineTest, ACameraThatStopsAnsweringPausesTheRunDarkAndResumes) {
  Open();
  camera_->silent = {3, 4, 5};
  Start(Shots(6));
  EXPECT_EQ(WaitState(1), RunState::kPausing);
  EXPECT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "DEVICE_SILENT");
  EXPECT_NE(MessageOf(reason()).find("shot 2, attempt 3"), std::string::npos) << reason();
  EXPECT_FALSE(lamps_->lit);
  ASSERT_TRUE(engine_->Resume().ok());
  ASSERT_EQ(Join(), RunState::kSucceeded);
  auto taken = ids();
  std::sort(taken.begin(), taken.end());
  EXPECT_THAT(taken, ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(EngineTest, ResumingGivesAFailingShotAllItsAttemptsAgain) {
  Open();
  camera_->all_incomplete = 2;
  Start(Shots(3));
  WaitState(2);
  int first = static_cast<int>(engine_->progress().retakes);
  ASSERT_TRUE(engine_->Resume().ok());
  WaitState(5);  // RUNNING, PAUSING, PAUSED again
  EXPECT_GE(static_cast<int>(engine_->progress().retakes) - first, 3);
  camera_->all_incomplete = 0;
  ASSERT_TRUE(engine_->Resume().ok());
  EXPECT_EQ(Join(), RunState::kSucceeded);
}

TEST_F(EngineTest, AFullDiskPausesAtOnceAndTheShotIsTakenAgain) {
  Open();
  {
    MutexLock lock(&mutex_);
    refuse_once_ = {2};
  }
  Start(Shots(6));
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "DISK_FULL");
  ASSERT_TRUE(engine_->Resume().ok());
  ASSERT_EQ(Join(), RunState::kSucceeded);
  auto taken = ids();
  std::sort(taken.begin(), taken.end());
  EXPECT_THAT(taken, ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(EngineTest, AManifestThatCannotBeWrittenHoldsTheRun) {
  Open();
  finish_ = Error(absl::StatusCode::kResourceExhausted, "DISK_FULL", "manifest.json: no space");
  Start(Shots(2));
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  finish_ = absl::OkStatus();
  ASSERT_TRUE(engine_->Resume().ok());
  EXPECT_EQ(Join(), RunState::kSucceeded);
  EXPECT_THAT(ids(), ElementsAre(0, 1));
}

TEST_F(EngineTest, StopLatchesPausesAndNeedsReset) {
  Open();
  Start(Shots(100000));
  while (count() < 5) std::this_thread::yield();
  ASSERT_TRUE(rig_->Stop(Error(absl::StatusCode::kAborted, "STOP_ASKED", "smoke")).ok());
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "STOP_ASKED");
  EXPECT_FALSE(lamps_->lit);
  EXPECT_EQ(ErrorReason(engine_->Resume()), "RIG_STOPPED");
  size_t before = log_.entries().size();
  EXPECT_FALSE(rig_->StartCondition({{{1, 1.0}}, {}})->Wait().ok());
  EXPECT_FALSE(rig_->StartPose({Degrees(77), Degrees(0)})->Wait().ok());
  EXPECT_EQ(log_.entries().size(), before) << "a device was commanded while the rig was stopped";
  ASSERT_TRUE(rig_->Reset().ok());
  ASSERT_TRUE(engine_->Resume().ok());
  while (count() < 50) std::this_thread::yield();
  ASSERT_TRUE(engine_->Cancel().ok());
  EXPECT_EQ(Join(), RunState::kCancelled);
  auto taken = ids();
  std::set<uint64_t> unique(taken.begin(), taken.end());
  EXPECT_EQ(unique.size(), taken.size()) << "a shot was stored twice";
  EXPECT_EQ(*unique.rbegin(), unique.size() - 1) << "a shot was left out";
}

// Stops (or halts) the rig in the middle of the 3rd exposure, which is shot 2's.
TEST_F(EngineTest, AShotDarkenedByStopIsNotStoredButTakenAgain) {
  Open();
  camera_->on_trigger = [this](int number) {
    if (number != 3) return;
    clock_.At(clock_.Now() + milliseconds(5), [this] {
      ASSERT_TRUE(rig_->Stop(Error(absl::StatusCode::kAborted, "STOP_ASKED", "smoke")).ok());
    });
  };
  Start(Shots(5));
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "STOP_ASKED");
  EXPECT_THAT(ids(), ElementsAre(0, 1));
  ASSERT_TRUE(rig_->Reset().ok());
  ASSERT_TRUE(engine_->Resume().ok());
  ASSERT_EQ(Join(), RunState::kSucceeded);
  EXPECT_THAT(ids(), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(engine_->progress().retakes, 0u) << "a stop is not the shot's fault";
}

TEST_F(EngineTest, AShotDarkenedWithoutStopIsTakenAgain) {
  Open();
  camera_->on_trigger = [this](int number) {
    if (number != 3) return;
    clock_.At(clock_.Now() + milliseconds(5), [this] { ASSERT_TRUE(rig_->Halt().ok()); });
  };
  Start(Shots(5));
  ASSERT_EQ(Join(), RunState::kSucceeded);
  EXPECT_EQ(engine_->progress().retakes, 1u);
  auto taken = ids();
  std::sort(taken.begin(), taken.end());
  EXPECT_THAT(taken, ElementsAre(0, 1, 2, 3, 4));
}

TEST_F(EngineTest, AShotWhoseLampsWentAwayInTheExposureIsTakenAgain) {
  Open();
  lamps_->lost_in_exposure = 3;
  Start(Shots(5));
  ASSERT_EQ(Join(), RunState::kSucceeded);
  EXPECT_EQ(engine_->progress().retakes, 1u);
  EXPECT_THAT(ids(), testing::UnorderedElementsAre(0, 1, 2, 3, 4));
  MutexLock lock(&mutex_);
  EXPECT_THAT(attempts_, testing::UnorderedElementsAre(1, 1, 2, 1, 1));
}

TEST_F(EngineTest, AShotWhoseAxisMovedInTheExposureIsTakenAgain) {
  Open();
  camera_->on_trigger = [this](int number) {
    if (number == 3) table_->Shift(Degrees(1));
  };
  Start(Shots(5));
  ASSERT_EQ(Join(), RunState::kSucceeded) << "it is moved back";
  EXPECT_EQ(engine_->progress().retakes, 1u);
  MutexLock lock(&mutex_);
  EXPECT_THAT(attempts_, testing::UnorderedElementsAre(1, 1, 2, 1, 1));
}

TEST_F(EngineTest, ALampThatConfirmsAnotherLevelIsNotExposed) {
  Open();
  lamps_->dead = 1;
  Start(Shots(3));
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "LIGHT_NOT_CONFIRMED");
  EXPECT_THAT(MessageOf(reason()), testing::HasSubstr("lamp 1: set to 1, the device confirmed 0"));
  EXPECT_THAT(ids(), ElementsAre(0));
}

TEST_F(EngineTest, TheRecordSaysWhatTheLampsCanDo) {
  Open();
  lamps_->SetSteps(255);
  Shot half = ShotOf(0, 0, 0);
  half.condition.lamps[0].level = 0.5;
  Start({half});
  ASSERT_EQ(Join(), RunState::kSucceeded);
  MutexLock lock(&mutex_);
  EXPECT_THAT(levels_, ElementsAre(testing::DoubleNear(128 / 255.0, 1e-6)));
}

TEST_F(EngineTest, LightGoesOutWhileTheStoreTakesNothing) {
  Open();
  stalls_ = {1};
  bool lit = true;
  camera_->on_trigger = [&](int) { lit &= lamps_->lit; };
  Start(Shots(4));
  ASSERT_EQ(Join(), RunState::kSucceeded);
  EXPECT_TRUE(lit) << "a shot was exposed in the dark";
  EXPECT_EQ(engine_->progress().retakes, 0u);
  EXPECT_THAT(ids(), ElementsAre(0, 1, 2, 3));
}

TEST_F(EngineTest, AFailedCameraIsConfiguredAnew) {
  Open();
  camera_->silent = {2};
  Start(Shots(3));
  ASSERT_EQ(Join(), RunState::kSucceeded);
  EXPECT_LT(log_.At("trigger", 1), log_.At("configure", 1)) << "a lost camera is reconnected so";
  EXPECT_LE(log_.At("configure", 1), log_.At("trigger", 2));
}

TEST_F(EngineTest, RetakesComeBeforeTheOperatorChangesTheScene) {
  Open();
  camera_->incomplete = {2};
  Start({ShotOf(0, 0, 0), ShotOf(1, 0, 0), OperatorRequest{"Take the object away."},
         ShotOf(2, 0, 0)});
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "OPERATOR_REQUEST");
  EXPECT_THAT(ids(), ElementsAre(0, 1));
  ASSERT_TRUE(engine_->Resume().ok());
  EXPECT_EQ(Join(), RunState::kSucceeded);
  EXPECT_THAT(ids(), ElementsAre(0, 1, 2));
}

TEST_F(EngineTest, PauseIsDarkAndIllegalCallsAreRefused) {
  Open();
  Start(Shots(100000));
  while (count() < 5) std::this_thread::yield();
  EXPECT_EQ(ErrorReason(engine_->Resume()), "RUN_STATE");
  ASSERT_TRUE(engine_->Pause().ok());
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_FALSE(lamps_->lit);
  EXPECT_EQ(ErrorReason(engine_->Pause()), "RUN_STATE");
  ASSERT_TRUE(engine_->Cancel().ok());
  EXPECT_EQ(Join(), RunState::kCancelled);
  EXPECT_EQ(ErrorReason(engine_->Cancel()), "RUN_STATE");
  EXPECT_EQ(ErrorReason(engine_->Resume()), "RUN_STATE");
}

TEST_F(EngineTest, AnAxisThatIsNotWhereItSaidIsNotExposed) {
  Open();
  table_->nudge = Degrees(0.5);
  Start(Shots(1));
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "POSE_NOT_HELD");
  EXPECT_EQ(log_.At("trigger"), -1);
}

TEST_F(EngineTest, AShotBeyondTheLimitsFailsTheRunBeforeAnythingMoves) {
  Open();
  Start({ShotOf(0, 10, 99)});
  EXPECT_EQ(Join(), RunState::kFailed);
  EXPECT_EQ(ErrorReason(reason()), "LAMP_UNKNOWN");
  EXPECT_EQ(log_.At("move"), -1);
}

TEST_F(EngineTest, AnOperatorRequestHoldsUntilResumed) {
  Open();
  Start({ShotOf(0, 0, 0), OperatorRequest{"Take the object away."}, ShotOf(1, 0, 0)});
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "OPERATOR_REQUEST");
  EXPECT_EQ(MessageOf(reason()), "Take the object away.");
  EXPECT_FALSE(lamps_->lit);
  EXPECT_THAT(ids(), ElementsAre(0));
  ASSERT_TRUE(engine_->Resume().ok());
  EXPECT_EQ(Join(), RunState::kSucceeded);
  EXPECT_THAT(ids(), ElementsAre(0, 1));
}

TEST_F(EngineTest, AfterAwaitResultsEveryShotHasItsRecord) {
  Open();
  Start({ShotOf(0, 0, 0), ShotOf(1, 0, 1), AwaitResults{}, ShotOf(2, 0, 2)});
  ASSERT_EQ(Join(), RunState::kSucceeded);
  EXPECT_EQ(program_->counts_seen[3], 2u);
}

TEST_F(EngineTest, AResumedRunHomesComparesAndTakesOnlyWhatIsMissing) {
  Open();
  int compared = 0;
  Engine::Resumption resumption{.reference = ShotOf(1, 0, 1),
                                .compare = [&](const RawShot& raw) -> absl::Status {
                                  ++compared;
                                  EXPECT_EQ(raw.frames.size(), 1u);
                                  return Error(absl::StatusCode::kFailedPrecondition,
                                               "REFERENCE_CHANGED", "camera was moved");
                                }};
  Start({ShotOf(0, 0, 0), OperatorRequest{"was met before shot 1"}, ShotOf(1, 0, 1),
         ShotOf(2, 0, 2), ShotOf(3, 0, 3)},
        {0, 1, 3}, resumption);
  ASSERT_EQ(WaitState(2), RunState::kPaused);
  EXPECT_EQ(ErrorReason(reason()), "REFERENCE_CHANGED");
  EXPECT_EQ(log_.entries().front().second, "dark");
  EXPECT_GE(log_.At("home"), 0);
  ASSERT_TRUE(engine_->Resume().ok());
  EXPECT_EQ(Join(), RunState::kSucceeded);
  EXPECT_EQ(compared, 1);
  EXPECT_THAT(ids(), ElementsAre(2));
}

TEST_F(EngineTest, InterruptEndsTheRunDark) {
  Open();
  Start(Shots(100000));
  while (count() < 5) std::this_thread::yield();
  engine_->Interrupt();
  EXPECT_EQ(Join(), RunState::kInterrupted);
  EXPECT_FALSE(lamps_->lit);
}

}  // namespace
}  // namespace lightstage
