#include "sim/rig/timeline.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lightstage::sim {
namespace {

TimePoint At(double seconds) { return TimePoint(FromSeconds(seconds)); }

TEST(LevelTimeline, RampsAndSteps) {
  LevelTimeline level;
  EXPECT_EQ(level.At(At(5)), 0);
  level.RampTo(At(10), At(12), 1);
  EXPECT_EQ(level.At(At(10)), 0);
  EXPECT_DOUBLE_EQ(level.At(At(10.5)), 0.25);
  EXPECT_EQ(level.At(At(12)), 1);
  EXPECT_EQ(level.At(At(1e6)), 1);
  level.RampTo(At(20), At(20), 0.5);
  EXPECT_EQ(level.At(At(19.999)), 1);
  EXPECT_EQ(level.At(At(20)), 0.5);
}

TEST(LevelTimeline, IntegralIsTheAreaBelow) {
  LevelTimeline level;
  level.RampTo(At(10), At(12), 1);
  level.RampTo(At(20), At(20), 0.5);
  EXPECT_EQ(level.Integral(At(0), At(10)), 0);
  EXPECT_NEAR(level.Integral(At(10), At(12)), 1, 1e-12);         // triangle
  EXPECT_NEAR(level.Integral(At(11), At(11.5)), 0.3125, 1e-12);  // trapezium (0.5 + 0.75)/2 · 0.5
  EXPECT_NEAR(level.Integral(At(0), At(30)), 1 + 8 + 5, 1e-12);
}

// Against light that is switched on and off in steps of 0.1 µs.
TEST(LevelTimeline, PulsesAddUpToTheLevel) {
  LevelTimeline lamp;
  lamp.RampTo(At(0), At(0), 0.3);
  lamp.RampTo(At(0.01), At(0.013), 0.9);
  lamp.RampTo(At(0.02), At(0.021), 0);
  constexpr double kHz = 2000;
  // Whole periods of a constant level.
  EXPECT_NEAR(lamp.PulsedIntegral(At(0.001), At(0.006), kHz), 0.3 * 0.005, 1e-9);
  // An exposure that is shorter than a period sees all or nothing.
  EXPECT_NEAR(lamp.PulsedIntegral(At(0.001), At(0.0011), kHz), 0.0001, 1e-9);
  EXPECT_NEAR(lamp.PulsedIntegral(At(0.0012), At(0.0014), kHz), 0, 1e-9);
  for (const auto& [a, b] :
       {std::pair(0.0003, 0.0088), std::pair(0.0098, 0.0124), std::pair(0.012, 0.0207)}) {
    double expected = 0;
    constexpr double kStep = 1e-7;
    for (double t = a; t < b; t += kStep) {
      const double middle = t + kStep / 2, phase = middle * kHz - std::floor(middle * kHz);
      expected += phase < lamp.At(At(middle)) ? kStep : 0;
    }
    EXPECT_NEAR(lamp.PulsedIntegral(At(a), At(b), kHz), expected, 2e-6) << a;
  }
}

TEST(LevelTimeline, NewRampStartsFromWhereTheOldOneWas) {
  LevelTimeline level;
  level.RampTo(At(0), At(10), 1);
  level.RampTo(At(4), At(8), 0);
  EXPECT_DOUBLE_EQ(level.At(At(2)), 0.2);
  EXPECT_DOUBLE_EQ(level.At(At(4)), 0.4);
  EXPECT_DOUBLE_EQ(level.At(At(6)), 0.2);
  EXPECT_EQ(level.At(At(9)), 0);
}

// The picture of an exposure must not depend on what was commanded to no effect, not even in the last bit.
TEST(LevelTimeline, RepeatingALevelChangesNothing) {
  LevelTimeline once, often;
  for (LevelTimeline* t : {&once, &often}) t->RampTo(At(1), At(1.002), 0.3);
  for (double t : {2.1, 2.2000001, 2.3}) often.RampTo(At(t), At(t + 0.002), 0.3);
  EXPECT_EQ(once.Integral(At(2), At(2.5)), often.Integral(At(2), At(2.5)));
}

TEST(LevelTimeline, ForgettingKeepsThePresent) {
  LevelTimeline level;
  level.RampTo(At(0), At(2), 1);
  level.RampTo(At(4), At(8), 0);
  level.Forget(At(6));
  EXPECT_DOUBLE_EQ(level.At(At(7)), 0.25);
  EXPECT_FALSE(level.IsIdle());
  level.Forget(At(20));
  EXPECT_TRUE(level.IsIdle());
}

AxisInfo Info(double velocity, double acceleration, Duration settle) {
  AxisInfo info;
  info.continuous = true;
  info.max_velocity_dps = velocity;
  info.max_acceleration_dps2 = acceleration;
  info.settle = settle;
  return info;
}

TEST(Motion, TakesAsLongAsTheContractSays) {
  const Duration settle = std::chrono::milliseconds(120);
  for (double distance : {0.001, 0.5, 5.625, 19.9, 20.1, 90.0, -90.0, 179.9}) {
    for (double velocity : {2.0, 20.0, 40.0}) {
      const AxisInfo info = Info(40, 20, settle);
      const AxisMechanics mechanics{20, settle, 0.05};
      Motion motion = Travel(At(3), 10, distance, 10 + distance, velocity, mechanics);
      const Duration expected = MoveDuration(info, Degrees(10), Degrees(10 + distance), velocity);
      EXPECT_NEAR(Seconds(motion.back().start - At(3)), Seconds(expected), 1e-8) << distance;
    }
  }
}

TEST(Motion, IsTrapezoidalAndContinuous) {
  // 4 °/s², 8 °/s: 2 s and 8° of speeding up, as much of slowing down, 3 s of 8 °/s over 40°.
  const AxisMechanics mechanics{4, std::chrono::seconds(1), 0.1};
  MotionTimeline axis;
  axis.Set(Travel(At(0), 0, 40, 400, 8, mechanics));  // a turn more: the same angle
  EXPECT_NEAR(axis.Position(At(1)), 2, 1e-9);
  EXPECT_NEAR(axis.Velocity(At(1)), 4, 1e-9);
  EXPECT_NEAR(axis.Position(At(2)), 8, 1e-9);
  EXPECT_NEAR(axis.Position(At(3.5)), 20, 1e-9);
  EXPECT_NEAR(axis.Velocity(At(3.5)), 8, 1e-9);
  EXPECT_NEAR(axis.Position(At(6)), 38, 1e-9);
  EXPECT_NEAR(axis.Velocity(At(6)), 4, 1e-9);
  EXPECT_TRUE(axis.Moving(At(7.5)));
  // Settling: it shakes about the target, less and less, and then stands exactly there.
  double early = 0, late = 0;
  for (double t = 7; t < 7.2; t += 0.001)
    early = std::max(early, std::abs(axis.Position(At(t)) - 400));
  for (double t = 7.8; t < 8; t += 0.001)
    late = std::max(late, std::abs(axis.Position(At(t)) - 400));
  EXPECT_GT(early, 0.05);
  EXPECT_LT(early, 0.1);
  EXPECT_LT(late, 0.05 * early);
  EXPECT_EQ(axis.Position(At(8)), 400);
  EXPECT_FALSE(axis.Moving(At(8)));
}

TEST(Motion, WayBoundsWhatItMoves) {
  MotionTimeline axis;
  axis.Set(Travel(At(0), 0, 40, 40, 8, {4, std::chrono::seconds(1), 0.1}));
  std::vector<TimePoint> cuts = {At(0), At(9)};
  axis.AppendBreaks(At(0), At(9), &cuts);
  std::sort(cuts.begin(), cuts.end());
  ASSERT_EQ(cuts.size(), 6u);  // plateau, braking, settling, rest
  double ways = 0;
  for (size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double way = axis.Way(cuts[i], cuts[i + 1]);
    for (double s = 0; s < 1; s += 0.01) {
      const TimePoint t = cuts[i] + FromSeconds(s * Seconds(cuts[i + 1] - cuts[i]));
      EXPECT_LE(std::abs(axis.Position(t) - axis.Position(cuts[i])), way + 1e-9);
    }
    ways += way;
  }
  EXPECT_EQ(axis.Way(cuts[4], cuts[5]), 0) << "at rest";
  EXPECT_LT(ways, 100);
}

TEST(Motion, TurnsUntilItsTimeIsOver) {
  MotionTimeline axis;
  // 2 s up to 8 deg/s over 8 deg, 3 s of 8 deg/s, 2 s down.
  axis.Set(Turn(At(1), 10, -8, At(6), {4, {}, 0}));
  EXPECT_NEAR(axis.Velocity(At(2)), -4, 1e-9);
  EXPECT_NEAR(axis.Position(At(3)), 10 - 8, 1e-9);
  EXPECT_NEAR(axis.Velocity(At(5)), -8, 1e-9);
  EXPECT_NEAR(axis.Position(At(6)), 10 - 8 - 24, 1e-9);
  EXPECT_TRUE(axis.Moving(At(7.9)));
  EXPECT_FALSE(axis.Moving(At(8.001)));
  EXPECT_NEAR(axis.Position(At(100)), 10 - 8 - 24 - 8, 1e-9);
  // Too short to come to speed.
  axis.Set(Turn(At(200), 0, 8, At(201), {4, {}, 0}));
  EXPECT_NEAR(axis.Velocity(At(201)), 4, 1e-9);
  EXPECT_NEAR(axis.Position(At(300)), 4, 1e-9);
}

TEST(Motion, BrakesWithinItsAcceleration) {
  MotionTimeline axis;
  axis.Set(Travel(At(0), 0, 90, 90, 8, {4, {}, 0}));
  const double position = axis.Position(At(5)), velocity = axis.Velocity(At(5));
  ASSERT_NEAR(velocity, 8, 1e-9);
  axis.Set(Brake(At(5), position, velocity, {4, {}, 0}));
  EXPECT_NEAR(axis.Position(At(6)), position + 6, 1e-9);
  EXPECT_NEAR(axis.Position(At(7)), position + 8, 1e-9);
  EXPECT_EQ(axis.Velocity(At(7.001)), 0);
  EXPECT_EQ(axis.Position(At(100)), axis.Position(At(7.001)));
}

}  // namespace
}  // namespace lightstage::sim
