// Strong types for angles and lengths. Time is std::chrono. Construct with Degrees(), Radians(), Meters(); read with the
// member that names the unit, so that no bare double crosses a room without its unit being said.
#pragma once

#include <cmath>
#include <compare>
#include <numbers>

namespace lightstage {

class Angle {
 public:
  constexpr Angle() = default;
  static constexpr Angle FromDegrees(double degrees) { return Angle(degrees); }
  static constexpr Angle FromRadians(double radians) {
    return Angle(radians * 180.0 / std::numbers::pi);
  }
  // Degrees are the stored unit: rig files and protocols speak degrees, and 5.625 must come back as 5.625.
  constexpr double degrees() const { return degrees_; }
  constexpr double radians() const { return degrees_ * std::numbers::pi / 180.0; }
  constexpr auto operator<=>(const Angle&) const = default;
  constexpr Angle operator-() const { return Angle(-degrees_); }
  constexpr Angle operator+(Angle o) const { return Angle(degrees_ + o.degrees_); }
  constexpr Angle operator-(Angle o) const { return Angle(degrees_ - o.degrees_); }
  constexpr Angle operator*(double s) const { return Angle(degrees_ * s); }
  constexpr double operator/(Angle o) const { return degrees_ / o.degrees_; }

 private:
  explicit constexpr Angle(double degrees) : degrees_(degrees) {}
  double degrees_ = 0;
};

constexpr Angle Degrees(double v) { return Angle::FromDegrees(v); }
constexpr Angle Radians(double v) { return Angle::FromRadians(v); }

// The same direction in [0°, 360°).
inline Angle WrapTurn(Angle a) {
  double d = std::fmod(a.degrees(), 360.0);
  if (d < 0) d += 360.0;
  return Degrees(d >= 360.0 ? 0.0 : d);
}

class Length {
 public:
  constexpr Length() = default;
  static constexpr Length FromMeters(double meters) { return Length(meters); }
  constexpr double meters() const { return meters_; }
  constexpr auto operator<=>(const Length&) const = default;

 private:
  explicit constexpr Length(double meters) : meters_(meters) {}
  double meters_ = 0;
};

constexpr Length Meters(double v) { return Length::FromMeters(v); }

}  // namespace lightstage
