// Light and motion as functions of time on the rig's clock. Values; not thread-safe.
#pragma once

#include <vector>

#include "base/clock.h"
#include "drivers/api/axis.h"

namespace lightstage::sim {

// A level that changes linearly between points in time and stays in between; 0 at first.
class LevelTimeline {
 public:
  // From `from` on it goes from what it is then to `level` at `to` ≥ from (a step if equal). `from` may not decrease between calls.
  void RampTo(TimePoint from, TimePoint to, double level);
  double At(TimePoint t) const;
  // ∫ level dt, in seconds; a ≤ b.
  double Integral(TimePoint a, TimePoint b) const;
  // ∫ of light that is on while the phase of its pulses, t · hz modulo 1, is below the level (pulse-width modulation); hz > 0.
  double PulsedIntegral(TimePoint a, TimePoint b, double hz) const;
  // Forgets what was before `t`.
  void Forget(TimePoint t);
  // Zero from now on, and nothing remembered.
  bool IsIdle() const { return points_.size() == 1 && points_.front().level == 0; }

 private:
  struct Point {
    TimePoint t;
    double level;
  };
  // body(begin, end, level at begin, level at end) for every stretch between a and b in which the level changes evenly.
  template <class Body>
  void ForPieces(TimePoint a, TimePoint b, Body body) const;

  std::vector<Point> points_{{TimePoint::min(), 0}};  // by time; never empty
};

// One stretch of an axis' motion: position + velocity·dt + acceleration/2·dt², in degrees, and a decaying shake.
struct MotionPiece {
  TimePoint start{};
  double position = 0, velocity = 0, acceleration = 0;
  double shake = 0;  // amplitude at the start, degrees
  double decay = 0;  // time constant of the shake, s
  bool still() const { return velocity == 0 && acceleration == 0 && shake == 0; }
};

// What an axis does from the first piece on; the last piece stands still for ever.
using Motion = std::vector<MotionPiece>;

// How an axis is built.
struct AxisMechanics {
  double max_acceleration_dps2 = 0;
  Duration settle{};
  double shake_deg = 0;  // amplitude when it comes to rest; gone after `settle`
};

// The trapezoidal way from standstill at `position` over `distance`, ending exactly at `target` (the same angle but for whole
// turns), as MoveDuration (drivers/api/axis.h) says; |velocity| ≤ velocity_dps > 0.
Motion Travel(TimePoint start, double position, double distance, double target, double velocity_dps,
              const AxisMechanics& mechanics);

// From standstill at `position` up to `velocity_dps`, signed, not 0, and back to standstill from `until` on.
Motion Turn(TimePoint start, double position, double velocity_dps, TimePoint until,
            const AxisMechanics& mechanics);

// Full braking from a velocity.
Motion Brake(TimePoint start, double position, double velocity, const AxisMechanics& mechanics);

class MotionTimeline {
 public:
  static constexpr double kShakeHz = 12;

  // Replaces what was planned from the motion's start on.
  void Set(const Motion& motion);
  double Position(TimePoint t) const;
  double Velocity(TimePoint t) const;  // of the drive, without shake
  bool Moving(TimePoint t) const;      // settling included
  TimePoint RestsAt() const { return pieces_.back().start; }
  // Appends the times in (a, b) at which it starts to move differently.
  void AppendBreaks(TimePoint a, TimePoint b, std::vector<TimePoint>* breaks) const;
  // At most how far it goes between a and b, degrees, if there is no break between them.
  double Way(TimePoint a, TimePoint b) const;
  void Forget(TimePoint t);

 private:
  const MotionPiece& PieceAt(TimePoint t) const;
  std::vector<MotionPiece> pieces_{{.start = TimePoint::min()}};  // by start; never empty
};

}  // namespace lightstage::sim
