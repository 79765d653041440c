// The rules of drivers/api/camera.h.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "drivers/conformance/rule.h"

namespace lightstage {

CameraConfig CameraFixture::config(const CameraInfo& info) const {
  return {info.formats.empty() ? PixelFormat::kMono8 : info.formats.front(), info.sensor_width,
          info.sensor_height, info.min_gain_db};
}

namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

class CameraBench : public Bench<CameraFixture, Camera> {
 public:
  using Bench::Bench;

  struct Shot {
    std::shared_ptr<Outcome<ExposureEnd>> ended;
    std::shared_ptr<Outcome<Frame>> frame;
  };

  const CameraInfo& info() { return device().info(); }
  CameraConfig config() { return fixture().config(info()); }

  absl::StatusOr<CameraConfig> Configure(const CameraConfig& config) {
    auto done = Expect<CameraConfig>("Configure");
    device().Configure(config, Deadline(), done->sink());
    return done->Wait(patience());
  }
  absl::StatusOr<CameraConfig> Arm() {
    auto done = Expect<CameraConfig>("Arm");
    device().Arm(Deadline(), done->sink());
    return done->Wait(patience());
  }
  absl::StatusOr<CameraConfig> Disarm() {
    auto done = Expect<CameraConfig>("Disarm");
    device().Disarm(Deadline(), done->sink());
    return done->Wait(patience());
  }
  Shot Trigger(Duration exposure, TimePoint deadline) {
    Shot shot{Expect<ExposureEnd>("exposure_ended"), Expect<Frame>("frame_ready")};
    device().Trigger(exposure, deadline, shot.ended->sink(), shot.frame->sink());
    return shot;
  }
  Shot Trigger(Duration exposure) {
    return Trigger(exposure, clock().Now() + exposure + patience());
  }
  void Wait(const Shot& shot) {
    shot.frame->Wait(patience() * 2);  // beyond its deadline
    shot.ended->Wait(patience());
    EXPECT_LT(shot.ended->number(), shot.frame->number())
        << "exposure_ended must come before frame_ready";
  }

  // True once configured as the fixture wants and armed.
  bool Ready() {
    if (!open()) return false;
    absl::StatusOr<CameraConfig> configured = Configure(config());
    EXPECT_TRUE(configured.ok()) << configured.status();
    if (!configured.ok()) return false;
    return ArmAgain();
  }
  bool ArmAgain() {
    absl::StatusOr<CameraConfig> armed = Arm();
    EXPECT_TRUE(armed.ok()) << armed.status();
    return armed.ok();
  }

  // A frame, retaken as often as the fixture allows; a test failure and nothing if there is none.
  std::optional<Frame> Take(Duration exposure) {
    for (int attempt = 0; attempt <= fixture().retakes(); ++attempt) {
      Shot shot = Trigger(exposure);
      Wait(shot);
      const absl::StatusOr<Frame>& frame = shot.frame->result();
      if (frame.ok()) {
        EXPECT_TRUE(shot.ended->result().ok()) << shot.ended->result().status();
        return *frame;
      }
      if (!absl::IsDataLoss(frame.status()) || attempt == fixture().retakes()) {
        ADD_FAILURE() << "no frame: " << frame.status();
        return std::nullopt;
      }
      ExpectError(frame.status(), absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE", "a lost frame");
    }
    return std::nullopt;
  }

  // Short enough for many frames, and within the camera's range.
  Duration ShortExposure() {
    return std::clamp<Duration>(milliseconds(2), info().min_exposure, info().max_exposure);
  }
  // Long enough to act while it lasts.
  Duration LongExposure() {
    return std::clamp<Duration>(seconds(1), info().min_exposure, info().max_exposure);
  }
  // Cameras that do not tell their step may round to a whole microsecond.
  Duration ExposureTolerance() { return std::max<Duration>(info().exposure_step, microseconds(1)); }
};

void ExpectFrameFits(const Frame& frame, const CameraConfig& config) {
  EXPECT_EQ(frame.format, config.format);
  EXPECT_EQ(frame.width, config.width);
  EXPECT_EQ(frame.height, config.height);
  int bytes = BytesPerSample(config.format);
  EXPECT_EQ(frame.data.size(), static_cast<size_t>(config.width) * config.height *
                                   SamplesPerPixel(config.format) * bytes)
      << PixelFormatName(config.format);
  EXPECT_GT(frame.significant_bits, 8 * (bytes - 1));
  EXPECT_LE(frame.significant_bits, 8 * bytes);
  EXPECT_DOUBLE_EQ(frame.gain_db, config.gain_db);
  if (bytes == 2 && frame.significant_bits < 16) {
    int above = 0;
    for (size_t i = 1; i < frame.data.size(); i += 2) {
      above += (static_cast<int>(frame.data[i]) >> (frame.significant_bits - 8)) != 0;
    }
    EXPECT_EQ(above, 0) << "samples above 2^" << frame.significant_bits << " - 1";
  }
}

void DescribesItself(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.open()) return;
  const CameraInfo& info = bench.info();
  EXPECT_FALSE(info.identity.name.empty());
  EXPECT_FALSE(info.identity.driver.empty());
  EXPECT_GT(info.sensor_width, 0);
  EXPECT_GT(info.sensor_height, 0);
  EXPECT_FALSE(info.formats.empty());
  EXPECT_EQ(std::set(info.formats.begin(), info.formats.end()).size(), info.formats.size());
  EXPECT_GT(info.min_exposure, Duration::zero());
  EXPECT_LE(info.min_exposure, info.max_exposure);
  EXPECT_GE(info.exposure_step, Duration::zero());
  EXPECT_LE(info.min_gain_db, info.max_gain_db);  // false for NaN
  EXPECT_GE(info.readout, Duration::zero());
}

void EveryOfferedFormatCanBeConfigured(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.open()) return;
  CameraConfig config = bench.config();
  for (PixelFormat format : bench.info().formats) {
    config.format = format;
    ConfigResult verdict = bench.device().Validate(config);
    EXPECT_EQ(verdict.verdict, ConfigVerdict::kValid) << PixelFormatName(format);
    EXPECT_EQ(verdict.config, config) << PixelFormatName(format);
    absl::StatusOr<CameraConfig> configured = bench.Configure(config);
    ASSERT_TRUE(configured.ok()) << PixelFormatName(format) << ": " << configured.status();
    EXPECT_EQ(*configured, config) << "Configure must read back what it applied";
  }
}

void UnusableConfigsAreExplainedAndRefused(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.open()) return;
  const CameraInfo& info = bench.info();
  const CameraConfig good = bench.config();
  std::vector<std::pair<std::string, CameraConfig>> bad(
      9, {"", CameraConfig{good.format, good.width, good.height, good.gain_db}});
  bad[0].first = "width 0", bad[0].second.width = 0;
  bad[1].first = "height 0", bad[1].second.height = 0;
  bad[2].first = "negative width", bad[2].second.width = -good.width;
  bad[3].first = "too wide", bad[3].second.width = info.sensor_width + 1;
  bad[4].first = "too high", bad[4].second.height = std::numeric_limits<int>::max();
  bad[5].first = "NaN gain", bad[5].second.gain_db = std::nan("");
  bad[6].first = "infinite gain", bad[6].second.gain_db = std::numeric_limits<double>::infinity();
  bad[7].first = "gain too high", bad[7].second.gain_db = info.max_gain_db + 1;
  bad[8].first = "gain too low", bad[8].second.gain_db = info.min_gain_db - 1;
  for (int f = 0; f <= static_cast<int>(PixelFormat::kRGB16); ++f) {
    CameraConfig config = good;
    config.format = static_cast<PixelFormat>(f);
    if (std::find(info.formats.begin(), info.formats.end(), config.format) == info.formats.end()) {
      bad.emplace_back(PixelFormatName(config.format), config);
    }
  }
  for (const auto& [what, config] : bad) {
    ConfigResult verdict = bench.device().Validate(config);
    EXPECT_NE(verdict.verdict, ConfigVerdict::kValid) << what;
    EXPECT_FALSE(verdict.notes.empty()) << what << ": the notes must say what is wrong";
    if (verdict.verdict == ConfigVerdict::kAdjusted) {
      ConfigResult again = bench.device().Validate(verdict.config);
      EXPECT_EQ(again.verdict, ConfigVerdict::kValid) << what << ": an adjusted config must work";
      EXPECT_EQ(again.config, verdict.config) << what;
    }
    absl::StatusOr<CameraConfig> configured = bench.Configure(config);
    EXPECT_FALSE(configured.ok()) << what << ": Configure takes valid configs only";
  }
  absl::StatusOr<CameraConfig> configured = bench.Configure(good);
  EXPECT_TRUE(configured.ok()) << "a refusal must leave the camera usable: " << configured.status();
}

void ExposuresAreCheckedAgainstTheRange(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.open()) return;
  const CameraInfo& info = bench.info();
  for (Duration inside : {info.min_exposure, info.max_exposure}) {
    EXPECT_EQ(bench.device().ValidateExposure(inside).verdict, ConfigVerdict::kValid)
        << Seconds(inside) << " s";
  }
  for (Duration outside : {Duration::zero(), -Duration(milliseconds(5)), Duration::min(),
                           info.max_exposure + seconds(1), info.max_exposure * 2}) {
    ExposureResult verdict = bench.device().ValidateExposure(outside);
    EXPECT_NE(verdict.verdict, ConfigVerdict::kValid) << Seconds(outside) << " s";
    EXPECT_FALSE(verdict.note.empty()) << Seconds(outside) << " s";
    if (verdict.verdict == ConfigVerdict::kAdjusted) {
      EXPECT_EQ(bench.device().ValidateExposure(verdict.exposure).verdict, ConfigVerdict::kValid);
    }
  }
}

void FramesAreWhatWasConfigured(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.open()) return;
  CameraConfig config = bench.config();
  for (PixelFormat format : bench.info().formats) {
    config.format = format;
    absl::StatusOr<CameraConfig> configured = bench.Configure(config);
    ASSERT_TRUE(configured.ok()) << configured.status();
    absl::StatusOr<CameraConfig> armed = bench.Arm();
    ASSERT_TRUE(armed.ok()) << armed.status();
    EXPECT_EQ(*armed, config);
    std::optional<Frame> frame = bench.Take(bench.ShortExposure());
    ASSERT_TRUE(frame) << PixelFormatName(format);
    ExpectFrameFits(*frame, config);
    ASSERT_TRUE(bench.Disarm().ok());
  }
}

void RegionOfInterestSetsTheFrameSize(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.open()) return;
  CameraConfig config = bench.config();
  config.width = std::max(1, config.width / 2);
  config.height = std::max(1, config.height / 2);
  ConfigResult verdict = bench.device().Validate(config);
  if (verdict.verdict == ConfigVerdict::kInvalid)
    return;  // a camera may have no region of interest
  config = verdict.config;
  absl::StatusOr<CameraConfig> configured = bench.Configure(config);
  ASSERT_TRUE(configured.ok()) << configured.status();
  EXPECT_EQ(*configured, config);
  ASSERT_TRUE(bench.ArmAgain());
  std::optional<Frame> frame = bench.Take(bench.ShortExposure());
  ASSERT_TRUE(frame);
  ExpectFrameFits(*frame, config);
}

void UsedExposureIsReported(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  Duration low = bench.info().min_exposure;
  std::vector<Duration> asked = {low, low * 7, microseconds(1500), milliseconds(20), low * 3};
  for (Duration exposure : asked) {
    ExposureResult expected = bench.device().ValidateExposure(exposure);
    if (expected.verdict != ConfigVerdict::kValid) continue;
    std::optional<Frame> frame = bench.Take(exposure);
    ASSERT_TRUE(frame);
    EXPECT_LE(std::chrono::abs(frame->exposure - expected.exposure), bench.ExposureTolerance())
        << "asked " << exposure.count() << " ns, reported " << frame->exposure.count() << " ns";
    EXPECT_LE(frame->exposure_start, frame->exposure_end);
    EXPECT_LE(frame->exposure_end, bench.clock().Now());
    EXPECT_LE(frame->latest_start.value_or(TimePoint{}), bench.clock().Now());
  }
}

void ExposureEndsWithinItsShot(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  for (int i = 0; i < 3; ++i) {
    TimePoint before = bench.clock().Now();
    CameraBench::Shot shot = bench.Trigger(milliseconds(10));
    bench.Wait(shot);
    if (absl::IsDataLoss(shot.frame->result().status()) && fixture.retakes() > 0) continue;
    ASSERT_TRUE(shot.ended->result().ok()) << shot.ended->result().status();
    EXPECT_GE(shot.ended->result()->time, before);
    EXPECT_LE(shot.ended->result()->time, bench.clock().Now());
  }
}

void SequenceStrictlyIncreases(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  uint64_t last = 0;
  bool first = true;
  for (int session = 0; session < 2; ++session) {
    for (int i = 0; i < 4; ++i) {
      std::optional<Frame> frame = bench.Take(bench.ShortExposure());
      ASSERT_TRUE(frame);
      EXPECT_TRUE(first || frame->sequence > last) << frame->sequence << " after " << last;
      last = frame->sequence;
      first = false;
    }
    ASSERT_TRUE(bench.Disarm().ok());
    ASSERT_TRUE(bench.ArmAgain());
  }
}

void BusyTriggerIsRefused(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  CameraBench::Shot first = bench.Trigger(bench.LongExposure());
  bool busy = !first.frame->done();
  CameraBench::Shot second = bench.Trigger(bench.ShortExposure());
  busy = busy && !first.frame->done();
  bench.Wait(second);
  if (busy) {
    for (const absl::Status& status :
         {second.ended->result().status(), second.frame->result().status()}) {
      ExpectError(status, absl::StatusCode::kFailedPrecondition, "CAMERA_BUSY", "second trigger");
    }
  }
  first.frame->Wait(bench.patience() + bench.LongExposure());
  bench.Wait(first);
  if (fixture.retakes() == 0) {
    EXPECT_TRUE(first.frame->result().ok())
        << "a refused trigger must not spoil the frame in progress: "
        << first.frame->result().status();
  }
  EXPECT_TRUE(bench.Take(bench.ShortExposure()));
}

void TriggerNeedsArming(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.open()) return;
  ASSERT_TRUE(bench.Configure(bench.config()).ok());
  auto refused = [&](const char* when) {
    CameraBench::Shot shot = bench.Trigger(bench.ShortExposure());
    bench.Wait(shot);
    ExpectError(shot.ended->result().status(), absl::StatusCode::kFailedPrecondition, "", when);
    ExpectError(shot.frame->result().status(), absl::StatusCode::kFailedPrecondition, "", when);
  };
  refused("before Arm");
  ASSERT_TRUE(bench.ArmAgain());
  EXPECT_TRUE(bench.Take(bench.ShortExposure()));
  ASSERT_TRUE(bench.Disarm().ok());
  refused("after Disarm");
}

void UnusableExposureIsRefused(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  for (Duration exposure : {Duration::zero(), -Duration(milliseconds(5)), Duration::min()}) {
    if (bench.device().ValidateExposure(exposure).verdict != ConfigVerdict::kInvalid) continue;
    CameraBench::Shot shot = bench.Trigger(exposure, bench.Deadline());
    bench.Wait(shot);
    EXPECT_FALSE(shot.ended->result().ok()) << Seconds(exposure);
    EXPECT_FALSE(shot.frame->result().ok()) << Seconds(exposure);
  }
  EXPECT_TRUE(bench.Take(bench.ShortExposure())) << "a refusal must leave the camera usable";
}

void ConfigureWhileArmedIsRefused(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  absl::StatusOr<CameraConfig> configured = bench.Configure(bench.config());
  ExpectError(configured.status(), absl::StatusCode::kFailedPrecondition, "", "while armed");
  EXPECT_TRUE(bench.Take(bench.ShortExposure()));
  ASSERT_TRUE(bench.Disarm().ok());
  EXPECT_TRUE(bench.Configure(bench.config()).ok());
}

void DisarmCancelsTheExposure(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  CameraBench::Shot shot = bench.Trigger(bench.LongExposure());
  SleepFor(bench.clock(), milliseconds(50));
  absl::StatusOr<CameraConfig> disarmed = bench.Disarm();
  EXPECT_TRUE(disarmed.ok()) << disarmed.status();
  EXPECT_TRUE(shot.frame->done()) << "Disarm must complete what is outstanding first";
  bench.Wait(shot);
  if (!shot.frame->result().ok() && !absl::IsDataLoss(shot.frame->result().status())) {
    ExpectError(shot.frame->result().status(), absl::StatusCode::kCancelled, "", "cut off");
  }
  ASSERT_TRUE(bench.ArmAgain());
  EXPECT_TRUE(bench.Take(bench.ShortExposure())) << "must work again after Disarm and Arm";
}

void DeadlineIsKept(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  TimePoint deadline = bench.clock().Now() + milliseconds(5);
  CameraBench::Shot shot = bench.Trigger(bench.LongExposure(), deadline);
  bench.Wait(shot);
  if (shot.frame->result().ok()) {
    // Devices on virtual time and null devices can be done in no time.
    EXPECT_LE(shot.frame->result()->exposure_end, deadline);
  } else {
    ExpectError(shot.frame->result().status(), absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                "frame");
    EXPECT_GE(shot.frame->called_at(), deadline) << "gave up too early";
  }
  // Whatever became of that exposure, the next ones are good, if need be once it is over.
  TimePoint give_up = bench.Deadline() + bench.LongExposure();
  while (bench.clock().Now() < give_up) {
    CameraBench::Shot next = bench.Trigger(bench.ShortExposure());
    bench.Wait(next);
    if (next.frame->result().ok()) return;
    SleepFor(bench.clock(), milliseconds(20));
  }
  ADD_FAILURE() << "no frame any more after a missed deadline";
}

void DestructorCompletesTheExposure(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  CameraBench::Shot shot = bench.Trigger(bench.LongExposure());
  SleepFor(bench.clock(), milliseconds(50));
  bool busy = !shot.frame->done();
  bench.Close();  // checks that both were called, once
  if (busy && !shot.frame->result().ok()) {
    ExpectError(shot.frame->result().status(), absl::StatusCode::kCancelled, "", "frame");
  }
  EXPECT_LT(shot.ended->number(), shot.frame->number());
}

void MayBeTriggeredFromItsCompletion(CameraFixture& fixture) {
  CameraBench bench(fixture);
  if (!bench.Ready()) return;
  constexpr int kFrames = 4;
  std::vector<CameraBench::Shot> shots;
  for (int i = 0; i < kFrames; ++i) {
    shots.push_back({bench.Expect<ExposureEnd>("exposure_ended"), bench.Expect<Frame>("frame")});
  }
  // Each frame starts the next one from inside its completion: no lock may be held there.
  std::function<void(int)> trigger = [&](int i) {
    if (i == kFrames) return;
    bench.device().Trigger(bench.ShortExposure(), bench.Deadline(), shots[i].ended->sink(),
                           shots[i].frame->sink([&trigger, i] { trigger(i + 1); }));
  };
  trigger(0);
  for (const CameraBench::Shot& shot : shots) {
    bench.Wait(shot);
    if (fixture.retakes() == 0 || !absl::IsDataLoss(shot.frame->result().status())) {
      EXPECT_TRUE(shot.frame->result().ok()) << shot.frame->result().status();
    }
  }
  bench.Close();  // before what the completions refer to
}

constexpr Rule<CameraFixture> kRules[] = {
    {"DescribesItself", DescribesItself},
    {"EveryOfferedFormatCanBeConfigured", EveryOfferedFormatCanBeConfigured},
    {"UnusableConfigsAreExplainedAndRefused", UnusableConfigsAreExplainedAndRefused},
    {"ExposuresAreCheckedAgainstTheRange", ExposuresAreCheckedAgainstTheRange},
    {"FramesAreWhatWasConfigured", FramesAreWhatWasConfigured},
    {"RegionOfInterestSetsTheFrameSize", RegionOfInterestSetsTheFrameSize},
    {"UsedExposureIsReported", UsedExposureIsReported},
    {"ExposureEndsWithinItsShot", ExposureEndsWithinItsShot},
    {"SequenceStrictlyIncreases", SequenceStrictlyIncreases},
    {"BusyTriggerIsRefused", BusyTriggerIsRefused},
    {"TriggerNeedsArming", TriggerNeedsArming},
    {"UnusableExposureIsRefused", UnusableExposureIsRefused},
    {"ConfigureWhileArmedIsRefused", ConfigureWhileArmedIsRefused},
    {"DisarmCancelsTheExposure", DisarmCancelsTheExposure},
    {"DeadlineIsKept", DeadlineIsKept},
    {"DestructorCompletesTheExposure", DestructorCompletesTheExposure},
    {"MayBeTriggeredFromItsCompletion", MayBeTriggeredFromItsCompletion},
};

}  // namespace

bool RegisterCameraConformance(const std::string& name, FixtureFactory<CameraFixture> make) {
  return RegisterRules("CameraConformance/" + name, kRules, std::move(make), __FILE__, __LINE__);
}

}  // namespace lightstage
