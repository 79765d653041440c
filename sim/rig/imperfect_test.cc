// What a real rig does to light and pictures, each effect alone against what it is said to be.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "sim/rig/lenses.h"
#include "sim/rig/test_rig.h"
#include "sim/rig/world.h"

namespace lightstage::sim {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr FilmSize kSize{32, 24};

double Sum(const Image& image, int channel) {
  double sum = 0;
  for (size_t i = static_cast<size_t>(channel); i < image.pixels().size(); i += 3)
    sum += image.pixels()[i];
  return sum;
}

// A world on a clock that stands still.
class Imperfect {
 public:
  explicit Imperfect(WorldOptions options, const RigGeometry& rig = Rig()) : rig_(rig) {
    options.samples = 2;
    auto world = World::Create(options, rig_, clock_);
    EXPECT_TRUE(world.ok()) << world.status();
    world_ = *world;
  }
  void Light(const std::vector<float>& levels) { world_->RampLamps(t0(), {}, {}, levels); }
  Image See(Duration exposure, Duration after = {}) {
    auto image = world_->Integrate(t0() + after, t0() + after + exposure, kSize);
    EXPECT_TRUE(image.ok()) << image.status();
    return *image;
  }
  World& world() { return *world_; }
  TimePoint t0() { return clock_.Now(); }

 private:
  const RigGeometry rig_;
  VirtualClock clock_;
  std::shared_ptr<World> world_;
};

Image Ideal(const std::vector<float>& levels, Duration exposure) {
  Imperfect ideal({});
  ideal.Light(levels);
  return ideal.See(exposure);
}

TEST(Lamps, HaveAColorAndSomeAreDimOrDead) {
  WorldOptions options;
  options.lamps.color = {1, 0.8, 0.5};
  options.lamps.dim = {{0, 0}, {1, 0.25}};
  Imperfect rig(options);
  rig.Light({1, 1, 0});
  const Image seen = rig.See(milliseconds(10)), one = Ideal({0, 1, 0}, milliseconds(10));
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(Sum(seen, c) / Sum(one, c), 0.25 * options.lamps.color[c], 1e-5);
  }
  options.lamps.dim = {{3, 0}};
  VirtualClock clock;
  const absl::Status unknown = World::Create(options, Rig(), clock).status();
  EXPECT_EQ(unknown.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(unknown.message().find("lamp 3 does not exist: this rig has 3"), std::string::npos)
      << unknown;
}

TEST(Lamps, RiseAndFallTakeTheirOwnTimes) {
  Imperfect rig({});
  rig.world().RampLamps(rig.t0(), milliseconds(8), milliseconds(2), {1, 0, 0});
  const double one = Sum(Ideal({1, 0, 0}, milliseconds(1)), 1);
  EXPECT_NEAR(Sum(rig.See(milliseconds(8)), 1) / one, 4, 1e-4);
  rig.world().RampLamps(rig.t0() + milliseconds(20), milliseconds(8), milliseconds(2), {0, 0, 0});
  EXPECT_NEAR(Sum(rig.See(milliseconds(10), milliseconds(20)), 1) / one, 1, 1e-4);
}

TEST(Lamps, PulsesMakeShortExposuresUneven) {
  WorldOptions options;
  options.lamps.pwm_hz = 500;  // periods of 2 ms, on for a quarter
  Imperfect rig(options);
  rig.Light({0.25f, 0, 0});
  const double one = Sum(Ideal({1, 0, 0}, milliseconds(1)), 1);
  EXPECT_NEAR(Sum(rig.See(milliseconds(20)), 1) / one, 5, 1e-4) << "whole periods";
  double least = 10, most = 0;
  for (int i = 0; i < 20; ++i) {
    const double seen = Sum(rig.See(microseconds(300), microseconds(100 * i)), 1) / one;
    least = std::min(least, seen);
    most = std::max(most, seen);
  }
  EXPECT_NEAR(least, 0, 1e-6);
  EXPECT_NEAR(most, 0.3, 1e-4);
}

TEST(Lamps, DriftEachAtItsOwnTime) {
  WorldOptions options;
  options.lamps.drift = 0.03;
  options.lamps.drift_period_s = 40;
  double phase[2];
  for (int lamp = 0; lamp < 2; ++lamp) {
    Imperfect rig(options);
    std::vector<float> levels(3);
    levels[lamp] = 1;
    rig.Light(levels);
    const double one = Sum(Ideal(levels, milliseconds(1)), 1);
    // Its first harmonic over a period.
    double c = 0, s = 0;
    for (int i = 0; i < 40; ++i) {
      const double seen = Sum(rig.See(milliseconds(1), seconds(i)), 1) / one - 1;
      EXPECT_LE(std::abs(seen), 0.0301);
      c += seen * std::cos(2 * std::numbers::pi * i / 40) / 20;
      s += seen * std::sin(2 * std::numbers::pi * i / 40) / 20;
    }
    EXPECT_NEAR(std::hypot(c, s), 0.03, 3e-4);
    phase[lamp] = std::atan2(s, c);
  }
  EXPECT_GT(std::abs(phase[0] - phase[1]), 0.1);
}

TEST(Projector, BlackIsNotDarkUntilItsLampGoesOut) {
  WorldOptions options;
  options.projector.black = 1.0 / 200;
  Imperfect rig(options);
  rig.world().RampProjection(rig.t0(), rig.t0(), Pattern{PatternArrangement::kFull});
  rig.world().RampProjection(rig.t0() + milliseconds(10), rig.t0() + milliseconds(10), Pattern{});
  rig.world().EndProjector(rig.t0() + milliseconds(20));
  const double white = Sum(rig.See(milliseconds(5)), 1);
  EXPECT_GT(white, 0);
  EXPECT_NEAR(Sum(rig.See(milliseconds(5), milliseconds(12)), 1) / white, 1.0 / 200, 1e-6);
  EXPECT_EQ(Sum(rig.See(milliseconds(5), milliseconds(22)), 1), 0);
}

TEST(Projector, EmitsThroughItsCurveAndVignette) {
  ProjectorOptics optics;
  optics.gamma = 2.2;
  optics.black = 0.01;
  optics.vignetting = 0.4;
  Image raster(64, 48, 1, 0.5f);
  raster.at(0, 0, 0) = 1;
  raster.at(32, 24, 0) = 0;
  const Image light = Emitted(raster, optics);
  const double middle = 0.5 * 0.5 + 0.5 * 0.5,
               corner = 32.0 * 32 + 24 * 24;  // squared distances, pixels
  EXPECT_NEAR(light.at(32, 24, 0), 0.01 * (1 - 0.4 * middle / corner), 1e-6);
  EXPECT_NEAR(light.at(31, 23, 0), (0.01 + 0.99 * std::pow(0.5, 2.2)) * (1 - 0.4 * middle / corner),
              1e-6);
  EXPECT_NEAR(light.at(0, 0, 0), 1 - 0.4 * (31.5 * 31.5 + 23.5 * 23.5) / corner, 1e-6);
  EXPECT_NEAR(light.at(63, 24, 0) / light.at(31, 23, 0),
              (1 - 0.4 * (31.5 * 31.5 + 0.25) / corner) / (1 - 0.4 * middle / corner), 1e-6);
}

TEST(Camera, VignettingAndBlurKeepWhatTheyShould) {
  CameraLens lens;
  lens.blur_px = 1.7;
  Image image(41, 41, 3);
  image.at(20, 20, 0) = 100;
  image.at(20, 20, 2) = 50;
  PassLens(lens, &image);
  double sum = 0, square = 0;
  for (int y = 0; y < 41; ++y) {
    for (int x = 0; x < 41; ++x) {
      sum += image.at(x, y, 0);
      square += image.at(x, y, 0) * ((x - 20) * (x - 20) + (y - 20) * (y - 20));
      EXPECT_NEAR(image.at(x, y, 2), image.at(x, y, 0) / 2, 1e-4);
    }
  }
  EXPECT_NEAR(sum, 100, 1e-3);
  EXPECT_NEAR(std::sqrt(square / sum / 2), 1.7, 0.01);

  Image white(40, 30, 1, 1.0f);
  PassLens({.vignetting = 0.3}, &white);
  EXPECT_NEAR(white.at(0, 0, 0), 1 - 0.3 * (19.5 * 19.5 + 14.5 * 14.5) / (20 * 20 + 15 * 15), 1e-6);
  EXPECT_NEAR(white.at(20, 15, 0), 1, 1e-3);
}

TEST(Camera, RollingShutterSeesAFlashInSomeRowsOnly) {
  WorldOptions options;
  options.sensor.line_time = microseconds(100);
  Imperfect rig(options);
  EXPECT_EQ(rig.world().RowLag(kSize.height), microseconds(2300));
  // A flash of 1 ms that begins 1 ms after the first row: row r is open from 0.1 r ms for 0.5 ms.
  rig.world().RampLamps(rig.t0() + milliseconds(1), {}, {}, {1, 0, 0});
  rig.world().RampLamps(rig.t0() + milliseconds(2), {}, {}, {0, 0, 0});
  const Image seen = rig.See(microseconds(500)), full = Ideal({1, 0, 0}, microseconds(500));
  for (int y = 0; y < kSize.height; ++y) {
    const double opens = 0.1 * y,
                 open =
                     std::clamp(std::min(opens + 0.5, 2.0) - std::max(opens, 1.0), 0.0, 0.5) / 0.5;
    for (int x = 0; x < 3 * kSize.width; ++x) {
      EXPECT_NEAR(seen.row(y)[x], open * full.row(y)[x], 1e-4f * full.row(y)[x] + 1e-9f)
          << "row " << y;
    }
  }
  auto frame =
      rig.world().Expose(rig.t0(), rig.t0() + microseconds(500), PixelFormat::kMono16, kSize, 12);
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(frame->exposure, microseconds(500));
  EXPECT_EQ(frame->exposure_end, rig.t0() + microseconds(500 + 2300));
}

TEST(Camera, AmbientLightLeaksInAllTheTime) {
  WorldOptions options;
  options.ambient_w_m2_sr = 0.02;
  Imperfect rig(options);
  const Image one = rig.See(milliseconds(10)), three = rig.See(milliseconds(30));
  EXPECT_GT(Sum(one, 1), 0);
  EXPECT_NEAR(Sum(three, 1) / Sum(one, 1), 3, 1e-4);
  EXPECT_LT(Sum(one, 1) / (kSize.width * kSize.height), 0.02 * 0.01)
      << "nothing is brighter than what is all around";
}

// Behind the camera a lamp is hidden; one beside it is not.
TEST(Parts, TheCameraHidesLamps) {
  RigGeometry rig = Rig();
  rig.camera.position = Vec3(0, -0.7, 0.35);
  const double tilt = std::atan2(0.7, 0.35) * 180 / std::numbers::pi;
  rig.brace.lamps = {{Degrees(-90), Degrees(tilt)}, {Degrees(-90), Degrees(tilt - 40)}};
  WorldOptions options;
  options.parts.camera_body = 0.1;
  Imperfect hidden(options, rig), open({}, rig);
  for (int lamp : {0, 1}) {
    std::vector<float> levels(2);
    levels[lamp] = 1;
    hidden.Light(levels);
    open.Light(levels);
    const double with = Sum(hidden.See(milliseconds(1)), 1),
                 without = Sum(open.See(milliseconds(1)), 1);
    EXPECT_GT(without, 0);
    if (lamp == 0) {
      EXPECT_LT(with, 0.1 * without);
    } else {
      EXPECT_NEAR(with, without, 1e-3 * without);
    }
  }
}

// The brace stands where the table's angle puts it: between projector and object, and before the camera that stands outside.
TEST(Parts, TheBraceHidesTheProjectorAndTheCamerasView) {
  RigGeometry rig = Rig();
  rig.brace.lamps.clear();
  for (int i = 0; i < 9; ++i) rig.brace.lamps.push_back({Degrees(0), Degrees(10 * i)});
  rig.projector.azimuth = Degrees(0);
  WorldOptions options;
  options.parts.brace_bar = 0.04;
  Imperfect braced(options, rig), open({}, rig);
  auto seen = [](Imperfect& world, double azimuth, double tilt) {
    world.world().RampProjection(world.t0(), world.t0(), Pattern{PatternArrangement::kFull});
    world.world().SetMotion(AxisRole::kTurntable, {{.start = world.t0(), .position = azimuth}});
    world.world().SetMotion(AxisRole::kTilt, {{.start = world.t0(), .position = tilt}});
    return Sum(world.See(milliseconds(1)), 1);
  };
  // The projector at the brace's azimuth looks at the object past the bar, which is 4 cm wide in a beam of 18 cm there.
  const double share = seen(braced, 20, 45) / seen(open, 20, 45);
  EXPECT_LT(share, 0.9);
  EXPECT_GT(share, 0.3);
  // At this angle the camera, 1.23 m from the origin, stands behind the bar.
  const double behind = seen(braced, 90, 0) / seen(open, 90, 0),
               beside = seen(braced, 40, 0) / seen(open, 40, 0);
  EXPECT_LT(behind, beside - 0.05);
}

// The projector's body and its gantry throw shadows of the lamps behind them.
TEST(Parts, TheGantryHidesLampsWhereItStands) {
  RigGeometry rig = Rig();
  rig.projector.distance = Meters(0.7);
  rig.brace.lamps = {{Degrees(0), Degrees(30)}};
  WorldOptions options;
  options.parts.projector_body = 0.3;
  options.parts.gantry_bar = 0.03;
  Imperfect world(options, rig);
  world.Light({1});
  auto seen = [&](double tilt) {
    world.world().SetMotion(AxisRole::kTilt, {{.start = world.t0(), .position = tilt}});
    return Sum(world.See(milliseconds(1)), 1);
  };
  EXPECT_LT(seen(30), 0.05 * seen(80));
}

TEST(World, APictureThatIsTooLargeIsRefusedWithTheFigure) {
  Imperfect rig({});
  EXPECT_TRUE(rig.world().CheckFilm({640, 480}).ok());
  const absl::Status status = rig.world().CheckFilm({16384, 16384});
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(status.message().find(" MB for its light paths"), std::string::npos) << status;
  EXPECT_NE(status.message().find("4096 MB"), std::string::npos) << status;
}

TEST(World, OnlyLampsThatThereAreCanBeDim) {
  VirtualClock clock;
  WorldOptions options;
  options.lamps.dim[3] = 0.5;
  const absl::Status status = World::Create(options, Rig(), clock).status();
  EXPECT_EQ(ErrorReason(status), "LAMP_UNKNOWN") << status;
  EXPECT_NE(status.message().find("lamp 3 does not exist: this rig has 3 lamps"), std::string::npos)
      << status;
}

// Long paths in a white medium take what they take, not what short ones would.
TEST(World, PathsInAMediumCount) {
  WorldOptions few, many;
  few.scene = many.scene = "materials";
  many.bounces = 1000;
  many.paths_bytes = few.paths_bytes = size_t{25} << 20;
  Imperfect direct(few), full(many);
  EXPECT_TRUE(direct.world().CheckFilm({320, 240}).ok());
  EXPECT_FALSE(full.world().CheckFilm({320, 240}).ok());
}

TEST(World, ACameraOrLightInTheObjectIsRefused) {
  VirtualClock clock;
  RigGeometry rig = Rig();
  rig.camera.position = Vec3(0, 0, -0.015);  // in the turntable's disc
  EXPECT_EQ(World::Create({}, rig, clock).status().code(), absl::StatusCode::kFailedPrecondition);
  rig = Rig();
  rig.brace.radius = Meters(0.09);
  rig.brace.lamps[1].tilt = Degrees(98);
  rig.projector.distance = Meters(0.02);
  Imperfect world({}, rig);
  auto see = [&] {
    return world.world().Integrate(world.t0(), world.t0() + milliseconds(1), kSize).status();
  };
  world.Light({1, 0, 0});
  EXPECT_TRUE(see().ok()) << see();
  world.Light({0, 1, 0});
  EXPECT_NE(see().message().find("lamp 1"), std::string::npos) << see();
  world.Light({0, 0, 0});
  world.world().RampProjection(world.t0(), world.t0(), Pattern{PatternArrangement::kFull});
  world.world().SetMotion(AxisRole::kTilt, {{.start = world.t0(), .position = 80}});
  EXPECT_NE(see().message().find("the projector"), std::string::npos) << see();
}

}  // namespace
}  // namespace lightstage::sim
