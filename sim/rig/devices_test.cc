// The simulated devices as a rig file makes them: contracts, time, faults, and the pictures they take together.
#include <gtest/gtest.h>

#include <map>

#include "drivers/conformance/fixtures.h"
#include "sim/rig/drivers.h"
#include "sim/rig/test_rig.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr const char* kSmall = R"(
[camera.options]
sensor_width = 32
sensor_height = 24
readout_ms = 4
[turntable]
settle_ms = 5
max_velocity_dps = 3600
max_acceleration_dps2 = 36000
[tilt]
settle_ms = 5
max_velocity_dps = 3600
max_acceleration_dps2 = 36000
[lamps]
settle_ms = 6
[projector]
[simulation]
samples = 2
)";

// All devices of a rig file.
class Bench {
 public:
  explicit Bench(Clock& clock, const std::string& text = kSmall) : clock_(clock) {
    simulation_ = RegisterSimulatedDrivers(registry_);
    auto document = TomlDocument::Parse(text, "rig.toml");
    EXPECT_TRUE(document.ok()) << document.status();
    const TomlTable& root = document->root();
    registry_.tables.at("simulation")(root.Table("simulation"));
    camera_opener_ = registry_.cameras.at("sim").parse(root.Table("camera").Table("options"));
    turntable_opener_ = registry_.axes.at("sim").parse(root.Table("turntable"));
    tilt_opener_ = registry_.axes.at("sim").parse(root.Table("tilt"));
    lamps_opener_ = registry_.lamps.at("sim").parse(root.Table("lamps"));
    projector_opener_ = registry_.projectors.at("sim").parse(root.Table("projector"));
    parsed_ = document->Finish();
    if (!parsed_.ok()) return;
    auto world = simulation_->OpenWorld(geometry_, clock);
    EXPECT_TRUE(world.ok()) << world.status();
    world_ = *world;
  }

  const absl::Status& parsed() const { return parsed_; }
  World& world() { return *world_; }
  absl::StatusOr<std::unique_ptr<Camera>> OpenCamera() { return Open(camera_opener_, "camera"); }
  absl::StatusOr<std::unique_ptr<Axis>> OpenTurntable() {
    return Open(turntable_opener_, "turntable");
  }
  absl::StatusOr<std::unique_ptr<Axis>> OpenTilt() { return Open(tilt_opener_, "tilt"); }
  absl::StatusOr<std::unique_ptr<Lamps>> OpenLamps() { return Open(lamps_opener_, "lamps"); }
  absl::StatusOr<std::unique_ptr<Projector>> OpenProjector() {
    return Open(projector_opener_, "projector");
  }

 private:
  template <class Device>
  absl::StatusOr<std::unique_ptr<Device>> Open(DeviceOpener<Device>& opener, const char* name) {
    return opener({name, &clock_, &geometry_});
  }

  Clock& clock_;
  const RigGeometry geometry_ = Rig();
  DriverRegistry registry_;
  std::shared_ptr<Simulation> simulation_;
  DeviceOpener<Camera> camera_opener_;
  DeviceOpener<Axis> turntable_opener_, tilt_opener_;
  DeviceOpener<Lamps> lamps_opener_;
  DeviceOpener<Projector> projector_opener_;
  absl::Status parsed_;
  std::shared_ptr<World> world_;
};

template <class ClockType, class Fixture>
class OnClock : public Fixture {
 public:
  Clock& clock() override { return clock_; }

 protected:
  ClockType clock_;
  Bench bench_{clock_};
};

template <class ClockType>
class CameraOn : public OnClock<ClockType, CameraFixture> {
  absl::StatusOr<std::unique_ptr<Camera>> Open() override { return this->bench_.OpenCamera(); }
};
template <class ClockType>
class TurntableOn : public OnClock<ClockType, AxisFixture> {
  absl::StatusOr<std::unique_ptr<Axis>> Open() override { return this->bench_.OpenTurntable(); }
};
template <class ClockType>
class TiltOn : public OnClock<ClockType, AxisFixture> {
  absl::StatusOr<std::unique_ptr<Axis>> Open() override { return this->bench_.OpenTilt(); }
};
template <class ClockType>
class LampsOn : public OnClock<ClockType, LampsFixture> {
  absl::StatusOr<std::unique_ptr<Lamps>> Open() override { return this->bench_.OpenLamps(); }
  std::optional<std::vector<float>> Emitted() override {
    return this->bench_.world().LampLevels(this->clock_.Now());
  }
};
template <class ClockType>
class ProjectorOn : public OnClock<ClockType, ProjectorFixture> {
  absl::StatusOr<std::unique_ptr<Projector>> Open() override {
    return this->bench_.OpenProjector();
  }
  std::optional<Pattern> OnWall() override {
    return std::get<Pattern>(this->bench_.world().Shown(this->clock_.Now()));
  }
};

template <class ClockType>
bool RegisterAll(const std::string& name) {
  RegisterCameraConformance("Sim" + name, [] { return std::make_unique<CameraOn<ClockType>>(); });
  RegisterAxisConformance("SimTurntable" + name,
                          [] { return std::make_unique<TurntableOn<ClockType>>(); });
  RegisterAxisConformance("SimTilt" + name, [] { return std::make_unique<TiltOn<ClockType>>(); });
  RegisterLampsConformance("Sim" + name, [] { return std::make_unique<LampsOn<ClockType>>(); });
  RegisterProjectorConformance("Sim" + name,
                               [] { return std::make_unique<ProjectorOn<ClockType>>(); });
  return true;
}
const bool kRegistered = RegisterAll<VirtualClock>("Virtual") && RegisterAll<RealClock>("Real");

// ---- All devices together

struct Devices {
  explicit Devices(Bench& bench) {
    camera = *bench.OpenCamera();
    turntable = *bench.OpenTurntable();
    tilt = *bench.OpenTilt();
    lamps = *bench.OpenLamps();
    projector = *bench.OpenProjector();
  }
  std::unique_ptr<Camera> camera;
  std::unique_ptr<Axis> turntable, tilt;
  std::unique_ptr<Lamps> lamps;
  std::unique_ptr<Projector> projector;
};

template <class T, class Start>
absl::StatusOr<T> Do(Clock& clock, Start start, Duration patience = seconds(20)) {
  Pending<T> pending(clock);
  const TimePoint deadline = clock.Now() + patience;
  start(deadline, pending.sink());
  return pending.Wait(deadline + seconds(5), "operation");
}

absl::StatusOr<AxisState> Move(Clock& clock, Axis& axis, double degrees,
                               Duration patience = seconds(20)) {
  return Do<AxisState>(
      clock,
      [&](TimePoint deadline, Completion<AxisState> done) {
        axis.Move(Degrees(degrees), 0, deadline, std::move(done));
      },
      patience);
}

void Prepare(Clock& clock, Devices& d) {
  for (Axis* axis : {d.turntable.get(), d.tilt.get()}) {
    ASSERT_TRUE(Do<AxisState>(clock, [&](TimePoint t, Completion<AxisState> done) {
                  axis->Home(t, std::move(done));
                }).ok());
  }
  ASSERT_TRUE(Do<CameraConfig>(clock, [&](TimePoint t, Completion<CameraConfig> done) {
                d.camera->Configure({PixelFormat::kRGB16, 32, 24, 0}, t, std::move(done));
              }).ok());
  ASSERT_TRUE(Do<CameraConfig>(clock, [&](TimePoint t, Completion<CameraConfig> done) {
                d.camera->Arm(t, std::move(done));
              }).ok());
}

absl::StatusOr<LampsState> Light(Clock& clock, Devices& d, const std::vector<float>& levels,
                                 Duration patience = seconds(20)) {
  return Do<LampsState>(
      clock,
      [&](TimePoint t, Completion<LampsState> done) { d.lamps->Set(levels, t, std::move(done)); },
      patience);
}

absl::StatusOr<Frame> Take(Clock& clock, Devices& d, Duration exposure,
                           Duration patience = seconds(20)) {
  Pending<ExposureEnd> ended(clock);
  Pending<Frame> frame(clock);
  const TimePoint deadline = clock.Now() + patience;
  d.camera->Trigger(exposure, deadline, ended.sink(), frame.sink());
  EXPECT_TRUE(ended.Wait(deadline + seconds(5), "exposure").ok() || patience < seconds(20));
  return frame.Wait(deadline + seconds(5), "frame");
}

// A light stage of two poses and a projector pattern.
std::vector<std::vector<std::byte>> Capture(Clock& clock) {
  Bench bench(clock);
  Devices d(bench);
  Prepare(clock, d);
  std::vector<std::vector<std::byte>> frames;
  auto take = [&] {
    auto frame = Take(clock, d, milliseconds(8));
    ASSERT_TRUE(frame.ok()) << frame.status();
    frames.push_back(frame->data);
  };
  for (double azimuth : {0.0, 5.625}) {
    EXPECT_TRUE(Move(clock, *d.turntable, azimuth).ok());
    for (const std::vector<float>& levels : {std::vector<float>{1, 0, 0}, {0, 0.5f, 1}}) {
      EXPECT_TRUE(Light(clock, d, levels).ok());
      take();
    }
  }
  EXPECT_TRUE(Light(clock, d, {0, 0, 0}).ok());
  EXPECT_TRUE(Move(clock, *d.tilt, 35).ok());
  Pattern pattern{PatternArrangement::kHorizontal, PatternProfile::kHat, 8, 2, 1, 4};
  EXPECT_TRUE(Do<ProjectorState>(clock, [&](TimePoint t, Completion<ProjectorState> done) {
                d.projector->Show(pattern, t, std::move(done));
              }).ok());
  take();
  return frames;
}

TEST(SimulatedRig, RealAndVirtualTimeGiveTheSameFrames) {
  VirtualClock virtual_clock;
  RealClock real_clock;
  const auto a = Capture(virtual_clock), b = Capture(real_clock);
  ASSERT_EQ(a.size(), 5u);
  EXPECT_EQ(a, b);
  for (size_t i = 1; i < a.size(); ++i) EXPECT_NE(a[i], a[i - 1]);
}

TEST(SimulatedRig, TimesAreWhatTheDevicesSay) {
  VirtualClock clock;
  Bench bench(clock);
  Devices d(bench);
  Prepare(clock, d);
  TimePoint start = clock.Now();
  ASSERT_TRUE(Move(clock, *d.turntable, 120).ok());
  EXPECT_NEAR(Seconds(clock.Now() - start),
              Seconds(MoveDuration(d.turntable->info(), Degrees(0), Degrees(120))), 1e-6);
  start = clock.Now();
  ASSERT_TRUE(Light(clock, d, {1, 1, 1}).ok());
  EXPECT_EQ(clock.Now() - start, milliseconds(6));
  start = clock.Now();
  auto frame = Take(clock, d, milliseconds(10));
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(clock.Now() - start, milliseconds(14));
  EXPECT_EQ(frame->exposure_start, start);
  EXPECT_EQ(frame->exposure_end, start + milliseconds(10));
  EXPECT_EQ(frame->exposure, milliseconds(10));
}

TEST(SimulatedRig, ExposureEndIsOnTimeInRealTime) {
  RealClock clock;
  Bench bench(clock);
  Devices d(bench);
  Prepare(clock, d);
  ASSERT_TRUE(Light(clock, d, {1, 1, 1}).ok());
  Duration::rep best = INT64_MAX;
  for (int i = 0; i < 5; ++i) {  // busy machines
    std::atomic<Duration::rep> late{-1};
    TimePoint start = clock.Now();
    Pending<Frame> frame(clock);
    d.camera->Trigger(
        milliseconds(30), start + seconds(20),
        [&](absl::StatusOr<ExposureEnd> end) {
          ASSERT_TRUE(end.ok());
          late = (clock.Now() - end->time).count();
        },
        frame.sink());
    ASSERT_TRUE(frame.Wait(start + seconds(20), "frame").ok());
    ASSERT_GE(late.load(), 0);
    best = std::min(best, late.load());
  }
  EXPECT_LT(best, Duration(milliseconds(500)).count());
}

TEST(SimulatedRig, RegionOfInterestIsCutFromTheMiddle) {
  VirtualClock clock;
  Bench bench(clock);
  Devices d(bench);
  Prepare(clock, d);
  ASSERT_TRUE(Light(clock, d, {1, 0, 0}).ok());
  const Frame whole = *Take(clock, d, milliseconds(10));
  ASSERT_TRUE(Do<CameraConfig>(clock, [&](TimePoint t, Completion<CameraConfig> done) {
                d.camera->Disarm(t, std::move(done));
              }).ok());
  ASSERT_TRUE(Do<CameraConfig>(clock, [&](TimePoint t, Completion<CameraConfig> done) {
                d.camera->Configure({PixelFormat::kRGB16, 8, 4, 0}, t, std::move(done));
              }).ok());
  ASSERT_TRUE(Do<CameraConfig>(clock, [&](TimePoint t, Completion<CameraConfig> done) {
                d.camera->Arm(t, std::move(done));
              }).ok());
  const Frame part = *Take(clock, d, milliseconds(10));
  ASSERT_EQ(part.data.size(), 8u * 4 * 6);
  for (int y = 0; y < 4; ++y) {
    EXPECT_TRUE(std::equal(part.data.begin() + y * 48, part.data.begin() + (y + 1) * 48,
                           whole.data.begin() + ((10 + y) * 32 + 12) * 6));
  }
}

TEST(SimulatedRig, AdjustsWhatTheCameraCannotDo) {
  VirtualClock clock;
  Bench bench(clock);
  auto camera = *bench.OpenCamera();
  ConfigResult odd = camera->Validate({PixelFormat::kBayerRG8, 31, 99, 3});
  EXPECT_EQ(odd.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(odd.config, (CameraConfig{PixelFormat::kBayerRG8, 30, 24, 3}));
  EXPECT_EQ(odd.notes.size(), 2u);
  EXPECT_EQ(camera->Validate({PixelFormat::kMono8, 31, 23, 0}).verdict, ConfigVerdict::kValid);
  ExposureResult fine = camera->ValidateExposure(Duration(1000500));
  EXPECT_EQ(fine.verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(fine.exposure, milliseconds(1));
}

TEST(SimulatedRig, LampsGoDarkByThemselves) {
  VirtualClock clock;
  Bench bench(clock);
  Devices d(bench);
  ASSERT_TRUE(d.lamps->SetTimeToDark(milliseconds(500)).ok());
  ASSERT_TRUE(Light(clock, d, {1, 1, 1}).ok());
  SleepFor(clock, milliseconds(400));
  ASSERT_TRUE(d.lamps->Refresh().ok());
  SleepFor(clock, milliseconds(490));
  EXPECT_EQ(bench.world().LampLevels(clock.Now())[0], 1);
  SleepFor(clock, milliseconds(20));  // 10 ms late, 6 of them to go dark
  EXPECT_EQ(bench.world().LampLevels(clock.Now())[0], 0);
}

// ---- Faults on purpose

TEST(Faults, SilentCameraMissesItsDeadlineOnce) {
  VirtualClock clock;
  Bench bench(clock);
  Devices d(bench);
  Prepare(clock, d);
  Faults faults;
  faults.camera_silent_at_frame = 2;
  bench.world().SetFaults(faults);
  EXPECT_TRUE(Take(clock, d, milliseconds(10)).ok());
  auto silent = Take(clock, d, milliseconds(10), milliseconds(200));
  EXPECT_EQ(silent.status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(ErrorReason(silent.status()), "DEVICE_SILENT");
  EXPECT_TRUE(Take(clock, d, milliseconds(10)).ok());
}

TEST(Faults, LostFrameIsDataLoss) {
  VirtualClock clock;
  Bench bench(clock, std::string(kSmall) + "[simulation.faults]\ncamera_incomplete_every = 3\n");
  Devices d(bench);
  Prepare(clock, d);
  for (int i = 1; i <= 6; ++i) {
    auto frame = Take(clock, d, milliseconds(10));
    EXPECT_EQ(frame.ok(), i % 3 != 0) << i << ": " << frame.status();
    if (!frame.ok()) {
      EXPECT_EQ(ErrorReason(frame.status()), "FRAME_INCOMPLETE");
    }
  }
}

TEST(Faults, StalledAxisReportsWhereItStands) {
  VirtualClock clock;
  Bench bench(clock, std::string(kSmall) + "[simulation.faults]\naxis_stall_at_move = 2\n");
  Devices d(bench);
  Prepare(clock, d);
  EXPECT_TRUE(Move(clock, *d.turntable, 10).ok());
  auto stalled = Move(clock, *d.turntable, 30, seconds(3));
  EXPECT_EQ(ErrorReason(stalled.status()), "DEVICE_SILENT");
  auto state = Do<AxisState>(clock, [&](TimePoint t, Completion<AxisState> done) {
    d.turntable->Read(t, std::move(done));
  });
  EXPECT_NEAR(state->position.degrees(), 20, 1e-9);
  EXPECT_FALSE(state->moving);
  EXPECT_TRUE(Move(clock, *d.turntable, 30).ok());
}

TEST(Faults, UnconfirmedLightIsAnError) {
  VirtualClock clock;
  Bench bench(clock);
  Devices d(bench);
  Faults faults;
  faults.lamps_refuse_at_set = 1;
  bench.world().SetFaults(faults);
  EXPECT_EQ(ErrorReason(Light(clock, d, {1, 0, 0}, milliseconds(100)).status()), "DEVICE_SILENT");
  EXPECT_TRUE(Light(clock, d, {0, 1, 0}).ok());
}

// ---- Rig files

TEST(RigFile, WrongValuesAreNamed) {
  const std::map<std::string, std::string> bad = {
      {"[camera.options]\nsensor_width = 33", "sensor_width"},
      {"[camera.options]\nbits = 8", "bits"},
      {"[camera.options]\nmin_exposure_us = 5000\nmax_exposure_ms = 2", "min_exposure_us"},
      {"[tilt]\nmin_deg = 50\nmax_deg = 40", "min_deg"},
      {"[lamps]\nsettle = 3", "settle"},
      {"[simulation]\nscene = \"teapot\"", "scene"},
      {"[simulation.sensor]\nresponse = \"table\"\nresponse_table = [0, 0.5, 0.4]",
       "response_table"},
      {"[simulation.sensor]\nresponse_gamma = 2", "response_gamma"},
      {"[simulation.lamps]\ncolor = [1, 1]", "color"},
      {"[[simulation.lamps.dim]]\nlamp = 1\n[[simulation.lamps.dim]]\nlamp = 1",
       "lamp 1 is dim already"},
      {"[simulation.projector]\ncontrast = 1", "contrast"},
      {"[simulation.faults]\naxis_stall_at_move = -1", "axis_stall_at_move"},
  };
  for (const auto& [text, key] : bad) {
    VirtualClock clock;
    Bench bench(clock, text);
    EXPECT_EQ(bench.parsed().code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_NE(bench.parsed().message().find(key), std::string::npos) << bench.parsed();
  }
}

TEST(RigFile, EverythingHasADefault) {
  VirtualClock clock;
  Bench bench(clock, "");
  EXPECT_TRUE(bench.parsed().ok()) << bench.parsed();
}

}  // namespace
}  // namespace lightstage::sim
