#include "drivers/api/axis.h"

#include <gtest/gtest.h>

#include <limits>

namespace lightstage {
namespace {

using std::chrono::milliseconds;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

AxisInfo Limited() {
  AxisInfo info;
  info.identity.name = "tilt";
  info.min = Degrees(-5);
  info.max = Degrees(90);
  info.max_velocity_dps = 20;
  info.max_acceleration_dps2 = 40;
  info.settle = milliseconds(100);
  return info;
}

AxisInfo Continuous() {
  AxisInfo info = Limited();
  info.identity.name = "turntable";
  info.continuous = true;
  return info;
}

TEST(MoveDistance, LimitedAxisGoesTheWholeWay) {
  EXPECT_DOUBLE_EQ(MoveDistance(Limited(), Degrees(-5), Degrees(90)).degrees(), 95);
  EXPECT_DOUBLE_EQ(MoveDistance(Limited(), Degrees(80), Degrees(10)).degrees(), -70);
}

TEST(MoveDistance, ContinuousAxisGoesTheShortWay) {
  EXPECT_DOUBLE_EQ(MoveDistance(Continuous(), Degrees(350), Degrees(10)).degrees(), 20);
  EXPECT_DOUBLE_EQ(MoveDistance(Continuous(), Degrees(10), Degrees(350)).degrees(), -20);
  EXPECT_DOUBLE_EQ(MoveDistance(Continuous(), Degrees(0), Degrees(725)).degrees(), 5);
  EXPECT_DOUBLE_EQ(std::abs(MoveDistance(Continuous(), Degrees(0), Degrees(180)).degrees()), 180);
}

TEST(CheckTurn, OnlyContinuousAxesWithinTheirSpeed) {
  EXPECT_TRUE(CheckTurn(Continuous(), 20).ok());
  EXPECT_TRUE(CheckTurn(Continuous(), -0.001).ok());
  for (double velocity : {0.0, 20.001, -20.001, kNan, kInf, -kInf}) {
    EXPECT_EQ(ErrorReason(CheckTurn(Continuous(), velocity)), "AXIS_VELOCITY") << velocity;
  }
  const absl::Status limited = CheckTurn(Limited(), 5);
  EXPECT_EQ(ErrorReason(limited), "AXIS_LIMITED");
  EXPECT_NE(limited.message().find("-5 to 90 deg"), std::string::npos) << limited;
  EXPECT_TRUE(CheckVelocity(Limited(), 5).ok());
}

TEST(MoveDuration, StandingStillCostsNothing) {
  EXPECT_EQ(MoveDuration(Limited(), Degrees(30), Degrees(30)), Duration::zero());
  EXPECT_EQ(MoveDuration(Continuous(), Degrees(0), Degrees(360)), Duration::zero());
}

// v = 20 °/s and a = 40 °/s²: 0.5 s and 5° for each ramp, the rest at 20 °/s.
TEST(MoveDuration, LongMoveCruises) {
  EXPECT_EQ(MoveDuration(Limited(), Degrees(0), Degrees(50)), milliseconds(3000 + 100));
}

TEST(MoveDuration, ShortMoveNeverReachesFullSpeed) {
  // 2.5° = ½ a t² twice over 1.25°: t = 2 √(2.5 / 40) s = 0.5 s.
  EXPECT_EQ(MoveDuration(Limited(), Degrees(2.5), Degrees(0)), milliseconds(500 + 100));
  // Exactly the two ramps: both formulas agree on 1 s.
  EXPECT_EQ(MoveDuration(Limited(), Degrees(0), Degrees(10)), milliseconds(1000 + 100));
}

TEST(MoveDuration, AskedVelocityCapsButNeverExceedsTheAxis) {
  // v = 10 °/s: ramps of 0.25 s and 1.25° each, 7.5° at 10 °/s.
  EXPECT_EQ(MoveDuration(Limited(), Degrees(0), Degrees(10), 10), milliseconds(1250 + 100));
  EXPECT_EQ(MoveDuration(Limited(), Degrees(0), Degrees(50), 1000), milliseconds(3000 + 100));
}

TEST(MoveDuration, ContinuousAxisCountsTheShortWay) {
  EXPECT_EQ(MoveDuration(Continuous(), Degrees(355), Degrees(5)), milliseconds(1000 + 100));
}

TEST(CheckTarget, LimitsAreInclusive) {
  EXPECT_TRUE(CheckTarget(Limited(), Degrees(-5)).ok());
  EXPECT_TRUE(CheckTarget(Limited(), Degrees(90)).ok());
  EXPECT_FALSE(CheckTarget(Limited(), Degrees(90.001)).ok());
  EXPECT_FALSE(CheckTarget(Limited(), Degrees(-5.001)).ok());
}

TEST(CheckTarget, ErrorNamesAxisValueAndLimits) {
  absl::Status status = CheckTarget(Limited(), Degrees(91.5));
  EXPECT_EQ(status.code(), absl::StatusCode::kOutOfRange);
  EXPECT_EQ(ErrorReason(status), "AXIS_LIMIT");
  EXPECT_EQ(status.message(), "tilt: target 91.5 deg is outside its limits: [-5, 90] deg");
}

TEST(CheckTarget, NanAndInfinityAreOutOfRangeEvenWithoutLimits) {
  for (double bad : {kNan, kInf, -kInf}) {
    EXPECT_EQ(ErrorReason(CheckTarget(Limited(), Degrees(bad))), "AXIS_LIMIT") << bad;
    EXPECT_EQ(ErrorReason(CheckTarget(Continuous(), Degrees(bad))), "AXIS_LIMIT") << bad;
  }
  EXPECT_TRUE(CheckTarget(Continuous(), Degrees(-1e6)).ok());
}

}  // namespace
}  // namespace lightstage
