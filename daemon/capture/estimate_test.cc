#include "daemon/capture/estimate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/status.h"
#include "daemon/capture/test_rig.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;

Estimate Of(const Plan& plan, const RigFacts& facts = TestRig()) {
  auto estimate = EstimatePlan(plan, facts);
  EXPECT_TRUE(estimate.ok()) << estimate.status();
  return estimate.value_or(Estimate());
}

TEST(Estimate, CountsAreThoseOfTheMethod) {
  Estimate stage = Of({{}, LightStagePlan{EvenAzimuths(32, Degrees(180)), AllLamps(40)}});
  EXPECT_EQ(stage.shots, 1280);
  EXPECT_EQ(stage.extra_shots, 0);
  EXPECT_EQ(stage.exposures, 2560);
  EXPECT_EQ(stage.positions, 32);

  Projector4dPlan full{CellCentredTilts(7), EvenAzimuths(32, Degrees(360)), 16, {}};
  EXPECT_EQ(Of({{}, full}).shots, 57344);
  EXPECT_EQ(Of({{}, full}).positions, 224);
  full.influence = 2;
  EXPECT_EQ(Of({{}, full}).shots, 21504);
  full = {CellCentredTilts(7), EvenAzimuths(8, Degrees(360)), 32, 3};
  EXPECT_EQ(Of({{}, full}).shots, 14336);

  Plan extra{{{}, 100, 1000}, LightStagePlan{EvenAzimuths(32, Degrees(180)), AllLamps(40)}};
  EXPECT_EQ(Of(extra).shots, 1280);
  EXPECT_EQ(Of(extra).extra_shots, 14 + 3);
  EXPECT_EQ(Of(extra).exposures, 2 * (1280 + 17));
}

// Two azimuths 45° apart, two lamps, bracket 1 ms + 8 ms, readout 30 ms, lamps settle 5 ms. The
// move: 45° at 90°/s with 0.1 s of acceleration: 0.5 + 0.1, and 0.1 s to settle.
TEST(Estimate, DurationOfASmallLightStage) {
  Plan plan{{}, LightStagePlan{{Degrees(0), Degrees(45)}, {0, 1}}};
  double bracket = 0.001 + 0.030 + 0.008;
  double expected = 0.005 + bracket    // lamp 0 comes on at the first position
                    + 0.030 + bracket  // lamp 1 settles during the readout
                    + 0.700 + bracket  // the table turns during the readout
                    + 0.030 + bracket  //
                    + 0.030;           // the last readout
  EXPECT_NEAR(Of(plan).duration_seconds, expected, 1e-9);

  RigFacts facts = TestRig();
  facts.camera.readout = milliseconds(2);
  bracket = 0.001 + 0.002 + 0.008;
  expected = 0.005 + bracket + 0.005 + bracket + 0.7 + bracket + 0.005 + bracket + 0.002;
  EXPECT_NEAR(Of(plan, facts).duration_seconds, expected, 1e-9);
}

// Both axes move to the first position at once: azimuth 90° takes 1 + 0.1 + 0.1 s, tilt 30° at
// 30°/s as long.
TEST(Estimate, DurationOfASmallProjectorSet) {
  RigFacts facts = TestRig();
  facts.default_exposures = {milliseconds(10)};
  Plan plan{{}, Projector4dPlan{{Degrees(30)}, {Degrees(90)}, 1, {}}};
  EXPECT_NEAR(Of(plan, facts).duration_seconds, 1.2 + 0.010 + 0.030, 1e-9);
  plan.common.dark_every = 1;  // 1.2, then the pattern settles within readout, then dark
  EXPECT_NEAR(Of(plan, facts).duration_seconds, 1.2 + 3 * (0.010 + 0.030), 1e-9);
}

TEST(Estimate, LightThatStaysNeedsNoSettling) {
  RigFacts facts = TestRig();
  facts.turntable.reset();
  facts.camera.readout = milliseconds(0);
  facts.default_exposures = {milliseconds(10)};
  Plan plan{{}, LightStagePlan{{Degrees(0)}, {0}}};
  plan.common.reference_every = 1;  // of one lamp: the same light three times
  EXPECT_NEAR(Of(plan, facts).duration_seconds, 0.005 + 0.030, 1e-9);
}

TEST(Estimate, Bytes) {
  CameraConfig config{PixelFormat::kRGB16, 100, 50, 0};
  EXPECT_EQ(EstimatedImageBytes(config, "none"), 100 * 50 * 3 * 2 + 4096);
  config.format = PixelFormat::kBayerRG8;
  EXPECT_EQ(EstimatedImageBytes(config, "none"), 100 * 50 * 3 * 2 + 4096);
  config.format = PixelFormat::kMono16;
  EXPECT_EQ(EstimatedImageBytes(config, "none"), 100 * 50 * 2 + 4096);
  EXPECT_LT(EstimatedImageBytes(config, "piz"), EstimatedImageBytes(config, "none"));
  Plan plan{{}, LightStagePlan{{Degrees(0)}, {0, 1}}};
  plan.common.dark_every = 10;
  EXPECT_EQ(Of(plan).bytes, 4 * (100 * 50 * 3 * 2 + 4096));
}

TEST(Estimate, RefusesWhatCannotRun) {
  EXPECT_EQ(ErrorReason(EstimatePlan({{}, LightStagePlan{{Degrees(0)}, {99}}}, TestRig()).status()),
            "LAMP_UNKNOWN");
}

}  // namespace
}  // namespace lightstage
