#include "drivers/api/axis.h"

#include <cmath>

#include "absl/strings/str_format.h"

namespace lightstage {

Angle MoveDistance(const AxisInfo& info, Angle from, Angle to) {
  Angle way = to - from;
  if (!info.continuous) return way;
  double turn = std::remainder(way.degrees(), 360.0);
  return Degrees(turn);
}

Duration MoveDuration(const AxisInfo& info, Angle from, Angle to, double velocity_dps) {
  double distance = std::abs(MoveDistance(info, from, to).degrees());
  if (distance == 0) return Duration::zero();
  double v =
      velocity_dps > 0 ? std::min(velocity_dps, info.max_velocity_dps) : info.max_velocity_dps;
  double a = info.max_acceleration_dps2;
  double ramps = v * v / a;  // way covered while speeding up and slowing down
  double t = distance >= ramps ? distance / v + v / a : 2 * std::sqrt(distance / a);
  return FromSeconds(t) + info.settle;
}

absl::Status CheckTarget(const AxisInfo& info, Angle target) {
  double t = target.degrees();
  bool inside = std::isfinite(t) && (info.continuous || (target >= info.min && target <= info.max));
  if (inside) return absl::OkStatus();
  std::string limits =
      info.continuous ? std::string("any finite angle")
                      : absl::StrFormat("[%g, %g] deg", info.min.degrees(), info.max.degrees());
  return Error(
      absl::StatusCode::kOutOfRange, "AXIS_LIMIT",
      absl::StrFormat("%s: target %g deg is outside its limits: %s", info.identity.name, t, limits),
      {{"axis", info.identity.name}, {"target_deg", absl::StrCat(t)}, {"limits", limits}});
}

absl::Status CheckVelocity(const AxisInfo& info, double velocity_dps) {
  const double speed = std::abs(velocity_dps);
  if (speed > 0 && speed <= info.max_velocity_dps) return absl::OkStatus();
  return Error(absl::StatusCode::kOutOfRange, "AXIS_VELOCITY",
               absl::StrFormat("%s: %g deg/s; its speed must be above 0 and at most %g deg/s",
                               info.identity.name, velocity_dps, info.max_velocity_dps),
               {{"axis", info.identity.name},
                {"velocity_dps", absl::StrCat(velocity_dps)},
                {"max_velocity_dps", absl::StrCat(info.max_velocity_dps)}});
}

absl::Status CheckTurn(const AxisInfo& info, double velocity_dps) {
  if (info.continuous) return CheckVelocity(info, velocity_dps);
  return Error(absl::StatusCode::kFailedPrecondition, "AXIS_LIMITED",
               absl::StrFormat("%s: goes from %g to %g deg and cannot turn without end",
                               info.identity.name, info.min.degrees(), info.max.degrees()),
               {{"axis", info.identity.name}});
}

}  // namespace lightstage
