#include "sim/rig/timeline.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lightstage::sim {
namespace {

constexpr double kShakeOmega = 2 * std::numbers::pi * MotionTimeline::kShakeHz;

void AppendRest(TimePoint t, double position, const AxisMechanics& mechanics, Motion* motion) {
  if (mechanics.settle > Duration::zero()) {
    // Five time constants: what is left at the end is below any encoder's step.
    motion->push_back({.start = t,
                       .position = position,
                       .shake = mechanics.shake_deg,
                       .decay = Seconds(mechanics.settle) / 5});
  }
  motion->push_back({.start = t + mechanics.settle, .position = position});
}

}  // namespace

// ---- LevelTimeline

void LevelTimeline::RampTo(TimePoint from, TimePoint to, double level) {
  const double now = At(from);
  while (points_.back().t > from) points_.pop_back();
  if (now == level && points_.back().level == level) return;  // constant already
  points_.push_back({from, now});
  points_.push_back({to, level});
}

double LevelTimeline::At(TimePoint t) const {
  auto after = std::upper_bound(points_.begin(), points_.end(), t,
                                [](TimePoint time, const Point& p) { return time < p.t; });
  const Point& a = *(after - 1);
  if (after == points_.end() || after->level == a.level) return a.level;
  return a.level + (after->level - a.level) * (Seconds(t - a.t) / Seconds(after->t - a.t));
}

template <class Body>
void LevelTimeline::ForPieces(TimePoint a, TimePoint b, Body body) const {
  for (size_t k = 0; k < points_.size(); ++k) {
    const TimePoint end = k + 1 < points_.size() ? std::min(points_[k + 1].t, b) : b;
    const TimePoint begin = std::max(points_[k].t, a);
    if (begin >= end) continue;
    auto level = [&](TimePoint t) {
      if (k + 1 == points_.size() || points_[k + 1].level == points_[k].level)
        return points_[k].level;
      const double share = Seconds(t - points_[k].t) / Seconds(points_[k + 1].t - points_[k].t);
      return points_[k].level + (points_[k + 1].level - points_[k].level) * share;
    };
    body(begin, end, level(begin), level(end));
  }
}

double LevelTimeline::Integral(TimePoint a, TimePoint b) const {
  double sum = 0;
  ForPieces(a, b, [&](TimePoint begin, TimePoint end, double from, double to) {
    sum += (from + to) / 2 * Seconds(end - begin);
  });
  return sum;
}

double LevelTimeline::PulsedIntegral(TimePoint a, TimePoint b, double hz) const {
  double sum = 0;
  ForPieces(a, b, [&](TimePoint begin, TimePoint end, double from, double to) {
    // In periods since the clock's zero.
    const double first = Seconds(begin.time_since_epoch()) * hz,
                 last = Seconds(end.time_since_epoch()) * hz;
    if (from == to) {
      // On in whole periods and the parts at both ends.
      auto on = [&](double phase) {
        return std::floor(phase) * from + std::min(phase - std::floor(phase), from);
      };
      sum += (on(last) - on(first)) / hz;
      return;
    }
    // While the level changes every period has its own share; of very many their mean is as good, to less than a pulse.
    constexpr double kManyPeriods = 1000;
    if (last - first > kManyPeriods) {
      sum += (from + to) / 2 * Seconds(end - begin);
      return;
    }
    const double slope = (to - from) / (last - first);
    for (double period = std::floor(first); period < last; ++period) {
      // The pulse that began at `period` ends when the phase has caught up with the level: p = level(period + p).
      const double level = from + slope * (period - first);
      const double length = slope < 1 ? std::clamp(level / (1 - slope), 0.0, 1.0) : 1;
      const double on_from = std::max(period, first), on_to = std::min(period + length, last);
      if (on_to > on_from) sum += (on_to - on_from) / hz;
    }
  });
  return sum;
}

void LevelTimeline::Forget(TimePoint t) {
  size_t drop = 0;
  while (drop + 1 < points_.size() && points_[drop + 1].t <= t) ++drop;
  points_.erase(points_.begin(), points_.begin() + static_cast<std::ptrdiff_t>(drop));
}

// ---- Motion

Motion Travel(TimePoint start, double position, double distance, double target, double velocity_dps,
              const AxisMechanics& mechanics) {
  Motion motion;
  const double way = std::abs(distance), sign = distance < 0 ? -1 : 1;
  const double a = mechanics.max_acceleration_dps2;
  const double v = std::min(velocity_dps, std::sqrt(way * a));  // a short way has no plateau
  const double ramp = v / a, plateau = std::max(0.0, way / v - ramp);
  motion.push_back({.start = start, .position = position, .acceleration = sign * a});
  if (plateau > 0) {
    motion.push_back({.start = start + FromSeconds(ramp),
                      .position = position + sign * v * ramp / 2,
                      .velocity = sign * v});
  }
  motion.push_back({.start = start + FromSeconds(ramp + plateau),
                    .position = position + sign * (way - v * ramp / 2),
                    .velocity = sign * v,
                    .acceleration = -sign * a});
  AppendRest(start + FromSeconds(2 * ramp + plateau), target, mechanics, &motion);
  return motion;
}

Motion Turn(TimePoint start, double position, double velocity_dps, TimePoint until,
            const AxisMechanics& mechanics) {
  const double a = std::copysign(mechanics.max_acceleration_dps2, velocity_dps);
  const double ramp = std::min(velocity_dps / a, Seconds(until - start));
  const double plateau = Seconds(until - start) - ramp;
  Motion motion{{.start = start, .position = position, .acceleration = a}};
  if (plateau > 0) {
    motion.push_back({.start = start + FromSeconds(ramp),
                      .position = position + a * ramp * ramp / 2,
                      .velocity = velocity_dps});
  }
  const Motion braking =
      Brake(until, position + a * ramp * (ramp / 2 + plateau), a * ramp, mechanics);
  motion.insert(motion.end(), braking.begin(), braking.end());
  return motion;
}

Motion Brake(TimePoint start, double position, double velocity, const AxisMechanics& mechanics) {
  Motion motion;
  const double a = mechanics.max_acceleration_dps2, time = std::abs(velocity) / a;
  motion.push_back({.start = start,
                    .position = position,
                    .velocity = velocity,
                    .acceleration = velocity < 0 ? a : -a});
  AppendRest(start + FromSeconds(time), position + velocity * time / 2, mechanics, &motion);
  return motion;
}

// ---- MotionTimeline

const MotionPiece& MotionTimeline::PieceAt(TimePoint t) const {
  auto after =
      std::upper_bound(pieces_.begin(), pieces_.end(), t,
                       [](TimePoint time, const MotionPiece& p) { return time < p.start; });
  return after == pieces_.begin() ? *after : *(after - 1);
}

void MotionTimeline::Set(const Motion& motion) {
  while (!pieces_.empty() && pieces_.back().start >= motion.front().start) pieces_.pop_back();
  pieces_.insert(pieces_.end(), motion.begin(), motion.end());
}

double MotionTimeline::Position(TimePoint t) const {
  const MotionPiece& p = PieceAt(t);
  if (p.still()) return p.position;
  const double dt = Seconds(t - p.start);
  double position = p.position + (p.velocity + p.acceleration / 2 * dt) * dt;
  if (p.shake != 0) position += p.shake * std::exp(-dt / p.decay) * std::sin(kShakeOmega * dt);
  return position;
}

double MotionTimeline::Velocity(TimePoint t) const {
  const MotionPiece& p = PieceAt(t);
  if (p.acceleration == 0) return p.velocity;
  return p.velocity + p.acceleration * Seconds(t - p.start);
}

bool MotionTimeline::Moving(TimePoint t) const { return t < RestsAt(); }

void MotionTimeline::AppendBreaks(TimePoint a, TimePoint b, std::vector<TimePoint>* breaks) const {
  for (const MotionPiece& piece : pieces_) {
    if (piece.start > a && piece.start < b) breaks->push_back(piece.start);
  }
}

double MotionTimeline::Way(TimePoint a, TimePoint b) const {
  const MotionPiece& p = PieceAt(a);
  if (p.still()) return 0;
  const double fastest =
      std::max(std::abs(Velocity(a)), std::abs(p.velocity + p.acceleration * Seconds(b - p.start)));
  const double shaking =
      p.shake == 0 ? 0
                   : std::abs(p.shake) * std::exp(-Seconds(a - p.start) / p.decay) * kShakeOmega;
  return (fastest + shaking) * Seconds(b - a);
}

void MotionTimeline::Forget(TimePoint t) {
  size_t drop = 0;
  while (drop + 1 < pieces_.size() && pieces_[drop + 1].start <= t) ++drop;
  pieces_.erase(pieces_.begin(), pieces_.begin() + static_cast<std::ptrdiff_t>(drop));
}

}  // namespace lightstage::sim
