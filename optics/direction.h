// Directions and rotations, as in the dissertation's §2.5.1: azimuth φ about +Z from +X towards +Y, tilt θ from +Z.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/units.h"

namespace lightstage {

using Vec3 = Eigen::Vector3d;

// Unit vector (sinθ cosφ, sinθ sinφ, cosθ).
inline Vec3 DirectionFromAngles(Angle azimuth, Angle tilt) {
  double st = std::sin(tilt.radians());
  return {st * std::cos(azimuth.radians()), st * std::sin(azimuth.radians()),
          std::cos(tilt.radians())};
}

struct AzimuthTilt {
  Angle azimuth;  // [0°, 360°)
  Angle tilt;     // [0°, 180°]
};

// Inverse of DirectionFromAngles for a vector of any length > 0; the azimuth of ±Z is 0.
inline AzimuthTilt AnglesOfDirection(const Vec3& d) {
  double xy = std::hypot(d.x(), d.y());
  return {xy == 0 ? Degrees(0) : WrapTurn(Radians(std::atan2(d.y(), d.x()))),
          Radians(std::atan2(xy, d.z()))};
}

// `v` turned by `angle` about +Z, counterclockwise seen from above.
inline Vec3 RotateAboutZ(const Vec3& v, Angle angle) {
  return Eigen::AngleAxisd(angle.radians(), Vec3::UnitZ()) * v;
}

}  // namespace lightstage
