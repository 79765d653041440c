// On virtual time, with a camera whose latency is known here and nowhere else.
#include "daemon/calibrate/latency.h"

#include <cmath>
#include <functional>

#include "daemon/calibrate/test_lamps.h"
#include "daemon/rig/testing/null_rig.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

// The light of the world over time.
class TestLight {
 public:
  void Set(TimePoint now, double level) { levels_.emplace_back(now, level); }
  double level() const { return levels_.back().second; }
  // Mean from `from` to `to`.
  double Mean(TimePoint from, TimePoint to) const {
    double sum = 0;
    for (size_t i = 0; i < levels_.size(); ++i) {
      const TimePoint begin = std::max(from, levels_[i].first);
      const TimePoint end = i + 1 < levels_.size() ? std::min(to, levels_[i + 1].first) : to;
      if (end > begin) sum += levels_[i].second * Seconds(end - begin);
    }
    return sum / Seconds(to - from);
  }

 private:
  std::vector<std::pair<TimePoint, double>> levels_ = {{TimePoint{}, 0.0}};
};

// Frame k begins at k intervals. It is stamped when the latency is over after the exposure of its first row, and a trigger gets the first one
// that can not have begun before it if the latency is taken for 0.
struct CameraTruth {
  Duration interval = milliseconds(20);
  Duration readout = milliseconds(8);  // from the first to the last row
  std::function<Duration(uint64_t frame)> latency = [](uint64_t) { return milliseconds(12); };
  Duration exposed_longer{};  // than asked
  double ambient = 8;         // codes without the light
  int black_rows = 0;         // at the top, where there is nothing to be lit
  std::function<bool(uint64_t frame)> sees = [](uint64_t) { return true; };
  std::function<bool(uint64_t frame)> damaged = [](uint64_t) { return false; };
  bool numbers_anew = false;  // from 1, whenever it is armed
};

class FreeRunningCamera final : public Camera {
 public:
  FreeRunningCamera(Clock& clock, const TestLight& light, const CameraTruth& truth)
      : clock_(clock), light_(light), truth_(truth), null_(clock, kWidth, kHeight) {}
  static constexpr int kWidth = 8, kHeight = 6;

  const CameraInfo& info() const override { return null_.info(); }
  ConfigResult Validate(const CameraConfig& config) const override {
    return null_.Validate(config);
  }
  ExposureResult ValidateExposure(Duration exposure) const override {
    return null_.ValidateExposure(exposure);
  }
  void Configure(const CameraConfig& config, TimePoint deadline,
                 Completion<CameraConfig> done) override {
    null_.Configure(config, deadline, std::move(done));
  }
  void Arm(TimePoint deadline, Completion<CameraConfig> done) override {
    if (truth_.numbers_anew) numbered_from_ = last_;
    null_.Arm(deadline, std::move(done));
  }
  void Disarm(TimePoint deadline, Completion<CameraConfig> done) override {
    null_.Disarm(deadline, std::move(done));
  }
  void Trigger(Duration exposure, TimePoint, Completion<ExposureEnd> ended,
               Completion<Frame> ready) override {
    const TimePoint now = clock_.Now();
    uint64_t frame = last_ + 1;
    while (Start(frame) + Late(frame) < now) ++frame;
    last_ = frame;
    const Duration exposed = exposure + truth_.exposed_longer;
    const TimePoint there =
        Start(frame) + exposed + std::max(truth_.latency(frame), truth_.readout) + milliseconds(1);
    clock_.At(there, [this, frame, exposure, exposed, ended = std::move(ended),
                      ready = std::move(ready)]() mutable {
      std::move(ended)(ExposureEnd{clock_.Now()});
      if (truth_.damaged(frame)) {
        return std::move(ready)(Error(absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE", "damaged"));
      }
      std::move(ready)(Picture(frame, exposure, exposed));
    });
  }

 private:
  TimePoint Start(uint64_t frame) const {
    return TimePoint(truth_.interval * static_cast<int64_t>(frame));
  }
  Duration Late(uint64_t frame) const { return truth_.latency(frame) + truth_.exposed_longer; }
  Frame Picture(uint64_t number, Duration exposure, Duration exposed) const {
    Frame frame;
    frame.width = kWidth;
    frame.height = kHeight;
    frame.exposure = exposure;
    frame.sequence = number - numbered_from_;
    frame.latest_start = Start(number) + Late(number);
    for (int y = 0; y < kHeight; ++y) {
      const TimePoint from = Start(number) + truth_.readout * y / kHeight;
      const double light =
          y >= truth_.black_rows && truth_.sees(number) ? light_.Mean(from, from + exposed) : 0;
      frame.data.insert(frame.data.end(), kWidth,
                        static_cast<std::byte>(std::lround(truth_.ambient + 200 * light)));
    }
    return frame;
  }

  Clock& clock_;
  const TestLight& light_;
  const CameraTruth truth_;
  NullCamera null_;
  uint64_t last_ = 0, numbered_from_ = 0;
};

// Its light changes at once.
class TestProjector final : public Projector {
 public:
  TestProjector(Clock& clock, Duration settle, TestLight& light)
      : clock_(clock), light_(light), null_(64, 64), info_(null_.info()) {
    info_.settle = settle;
  }
  const ProjectorInfo& info() const override { return info_; }
  void Show(const Pattern& pattern, TimePoint, Completion<ProjectorState> done) override {
    light_.Set(clock_.Now(), pattern.arrangement == PatternArrangement::kFull ? 1 : 0);
    clock_.At(clock_.Now() + info_.settle, [pattern, done = std::move(done)]() mutable {
      std::move(done)(ProjectorState{pattern});
    });
  }
  void Black(TimePoint deadline, Completion<ProjectorState> done) override {
    Show({}, deadline, std::move(done));
  }

 private:
  Clock& clock_;
  TestLight& light_;
  NullProjector null_;
  ProjectorInfo info_;
};

class LatencyTest : public testing::Test {
 protected:
  LatencyTest() {
    file_->turntable = {};
    file_->tilt = {};
    file_->camera_options.config = {PixelFormat::kMono8, FreeRunningCamera::kWidth,
                                    FreeRunningCamera::kHeight, 0};
    file_->camera_options.exposures = {milliseconds(4)};
  }
  absl::StatusOr<LatencyReport> Measure(const CameraTruth& truth) {
    return Measure(std::make_unique<FreeRunningCamera>(clock_, light_, truth));
  }
  absl::StatusOr<LatencyReport> Measure(std::unique_ptr<Camera> camera) {
    file_->camera = TableOf<Camera>(std::move(camera));
    file_->lamps = {};
    if (lamps_) {
      file_->lamps = TableOf<Lamps>(
          std::make_unique<TestLamps>(clock_, lamps_->delay, lamps_->settle, [this](double level) {
            if (level > 0 && --lamps_work_for_ < 0) level = 0;
            light_.Set(clock_.Now(), level);
          }));
    }
    file_->projector = {};
    if (projector_settle_) {
      file_->projector =
          TableOf<Projector>(std::make_unique<TestProjector>(clock_, *projector_settle_, light_));
    }
    auto rig = Rig::Open(*file_, clock_);
    if (!rig.ok()) return rig.status();
    TimePoint asked = clock_.Now();
    auto report = MeasureLatency(**rig, [&] {
      longest_unasked_ =
          std::max(longest_unasked_, clock_.Now() - std::exchange(asked, clock_.Now()));
      return --interrupt_in_ < 0;
    });
    SleepFor(clock_, seconds(1));
    EXPECT_EQ(light_.level(), 0) << "it is left dark";
    EXPECT_EQ((*rig)->use(), RigUse::kNone);
    return report;
  }
  void ExpectRefused(const CameraTruth& truth, const std::string& reason, const std::string& part) {
    const absl::Status refused = Measure(truth).status();
    EXPECT_EQ(ErrorReason(refused), reason) << refused;
    EXPECT_THAT(MessageOf(refused), HasSubstr(part));
  }

  VirtualClock clock_;
  TestLight light_;
  std::unique_ptr<RigFile> file_ = NullRigFile(clock_);
  struct LampTimes {
    Duration delay, settle;
  };
  std::optional<LampTimes> lamps_ = LampTimes{milliseconds(1), milliseconds(2)};
  std::optional<Duration> projector_settle_;
  int lamps_work_for_ = INT_MAX;  // switches
  int interrupt_in_ = INT_MAX;    // questions
  Duration longest_unasked_{};
};

TEST_F(LatencyTest, IsNeverTooShortAndAtMostAFrameTooLong) {
  for (Duration interval : {milliseconds(10), milliseconds(33), milliseconds(100)}) {
    for (Duration latency :
         {microseconds(0), microseconds(3100), microseconds(29700), microseconds(250000)}) {
      for (Duration readout : {Duration(), interval / 2}) {
        CameraTruth truth;
        truth.interval = interval;
        truth.readout = readout;
        truth.latency = [latency](uint64_t) { return latency; };
        const auto report = Measure(truth);
        ASSERT_TRUE(report.ok()) << report.status();
        const std::string which = LatencyToml(*report);
        EXPECT_GE(report->latency(), latency) << which;
        // The light's delay is in it.
        EXPECT_LE(report->latency(), latency + interval / 2 + milliseconds(1)) << which;
        EXPECT_GE(report->without_light, latency) << which << "before anything is added";
        EXPECT_LE(report->with_light - report->light_time, latency) << which;
        EXPECT_EQ(report->light_time, milliseconds(2));
      }
    }
  }
}

// By the time that the light needs it can be too long, and says so.
TEST_F(LatencyTest, SlowLightMakesItLonger) {
  lamps_ = {milliseconds(15), milliseconds(40)};
  const auto report = Measure(CameraTruth());
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_GE(report->latency(), milliseconds(12 + 15));
  EXPECT_LE(report->latency(), milliseconds(12 + 15 + 10));
  EXPECT_EQ(report->light_time, milliseconds(40));
  EXPECT_THAT(LatencyToml(*report), HasSubstr("from 0.0 ms to this"));
}

// Which is what the margin is for.
TEST_F(LatencyTest, ALatencyThatVariesCountsWithItsLongest) {
  CameraTruth truth;
  truth.latency = [](uint64_t frame) {
    return milliseconds(12) + microseconds(frame * 2654435761u % 4000);
  };
  const auto report = Measure(truth);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_GE(report->latency(), milliseconds(16));
  EXPECT_LE(report->latency(), milliseconds(16 + 12));
}

TEST_F(LatencyTest, TheExposureThatNeedsMoreCounts) {
  file_->camera_options.exposures = {milliseconds(2), milliseconds(5), milliseconds(16)};
  CameraTruth truth;
  truth.exposed_longer = milliseconds(3);
  const auto report = Measure(truth);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_GE(report->latency(), milliseconds(15));
  EXPECT_LE(report->latency(), milliseconds(15 + 12));
  EXPECT_EQ(report->exposures, (std::vector<Duration>{milliseconds(2), milliseconds(16)}));
  EXPECT_GE(report->switches, 80);
}

TEST_F(LatencyTest, DamagedFramesAreTakenAgain) {
  CameraTruth truth;
  truth.damaged = [](uint64_t frame) { return frame % 7 < 2; };
  truth.numbers_anew = true;
  const auto report = Measure(truth);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_GE(report->latency(), milliseconds(12));
  EXPECT_LE(report->latency(), milliseconds(12 + 11));
  truth.damaged = [](uint64_t frame) { return frame > 100; };
  ExpectRefused(truth, "FRAME_INCOMPLETE", "damaged");
}

TEST_F(LatencyTest, TheFasterLightIsTaken) {
  lamps_ = {milliseconds(2), milliseconds(40)};
  projector_settle_ = milliseconds(17);
  auto report = Measure(CameraTruth());
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->light, "projector");
  EXPECT_EQ(report->light_time, milliseconds(17));
  EXPECT_GE(report->latency(), milliseconds(12));
  lamps_ = {milliseconds(1), milliseconds(2)};
  report = Measure(CameraTruth());
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->light, "lamps");
  lamps_.reset();
  report = Measure(CameraTruth());
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->light, "projector");
}

TEST_F(LatencyTest, WithoutLightThereIsNothingToMeasure) {
  lamps_.reset();
  ExpectRefused({}, "LATENCY_NO_LIGHT", "neither [lamps] nor [projector]");
}

TEST_F(LatencyTest, ACameraThatIsTriggeredHasNone) {
  const absl::Status refused = Measure(std::make_unique<NullCamera>(clock_, 8, 6)).status();
  EXPECT_EQ(ErrorReason(refused), "LATENCY_NOT_NEEDED") << refused;
  EXPECT_THAT(MessageOf(refused), HasSubstr("driver null"));
}

TEST_F(LatencyTest, LightThatMakesNoDifferenceIsRefused) {
  CameraTruth truth;
  truth.sees = [](uint64_t) { return false; };
  ExpectRefused(truth, "LIGHT_NOT_SEEN", "row 0");
  // The rows that are exposed first are not known to be lit.
  truth = {};
  truth.black_rows = 2;
  ExpectRefused(truth, "LIGHT_NOT_SEEN", "row 0");
  truth = {};
  truth.ambient = 250;  // what is bright already
  ExpectRefused(truth, "LIGHT_NOT_SEEN", "darken the room");
  truth = {};
  truth.sees = [](uint64_t frame) { return frame % 3 != 0; };
  ExpectRefused(truth, "LIGHT_NOT_SEEN", "row 0");
}

TEST_F(LatencyTest, LampsThatFailOnTheWayAreNoticed) {
  lamps_work_for_ = 20;
  ExpectRefused({}, "LIGHT_NOT_SEEN", "not as bright");
}

TEST_F(LatencyTest, ALatencyOfMoreThanASecondIsNotMistaken) {
  CameraTruth truth;
  truth.latency = [](uint64_t) { return milliseconds(1500); };
  const absl::Status refused = Measure(truth).status();
  EXPECT_EQ(ErrorReason(refused), "LIGHT_NOT_SEEN") << refused;
}

TEST_F(LatencyTest, CanBeInterrupted) {
  interrupt_in_ = 5;
  ExpectRefused({}, "INTERRUPTED", "interrupted");
}

TEST_F(LatencyTest, IsNeverDeafForLong) {
  file_->camera_options.exposures = {seconds(10)};
  file_->engine.device_timeout = seconds(30);
  CameraTruth truth;
  truth.interval = seconds(10);
  const auto report = Measure(truth);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_LE(longest_unasked_, milliseconds(500));
}

TEST_F(LatencyTest, TheLineCanBePastedAndIsRoundedUp) {
  LatencyReport report;
  report.light = "lamps";
  report.exposures = {microseconds(1000), microseconds(16000)};
  report.switches = 80;
  report.with_light = microseconds(11900);
  report.without_light = microseconds(12310);
  report.margin = milliseconds(5);
  report.light_time = milliseconds(2);
  EXPECT_EQ(
      LatencyToml(report),
      "# Measured by switching the lamps off 80 times, with exposures of 1000 us and 16000 us.\n"
      "# Frames that by their time stamps began up to 11.9 ms after the command had light, those "
      "from 12.3 ms on had none.\n"
      "# A quarter of a frame, 5.0 ms, is added for what so few frames do not show. The light "
      "confirmed up to 2.0 ms\n"
      "# after the command; when before that it went off can not be told, so that the latency is "
      "from 9.9 ms to this.\n"
      "latency_ms = 17.4\n");
}

}  // namespace
}  // namespace lightstage
