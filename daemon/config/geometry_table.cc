#include "daemon/config/geometry_table.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

constexpr double kSameDirectionDegrees = 0.01;

// A point on a half circle through the zenith: negative tilts lie on the side opposite to `azimuth`.
LampGeometry OnBrace(Angle azimuth, double signed_tilt_deg) {
  Angle side = signed_tilt_deg < 0 ? azimuth + Degrees(180) : azimuth;
  return {WrapTurn(side), Degrees(std::abs(signed_tilt_deg))};
}

std::string LampText(size_t index, const LampGeometry& lamp) {
  return absl::StrFormat("lamp %d (azimuth %g deg, tilt %g deg)", index, lamp.azimuth.degrees(),
                         lamp.tilt.degrees());
}

// What is wrong with lamp `index` because of one before it; empty if nothing.
std::string SameDirection(const std::vector<LampGeometry>& lamps, size_t index) {
  Vec3 own = DirectionFromAngles(lamps[index].azimuth, lamps[index].tilt);
  for (size_t i = 0; i < index; ++i) {
    Vec3 other = DirectionFromAngles(lamps[i].azimuth, lamps[i].tilt);
    double apart = std::atan2(own.cross(other).norm(), own.dot(other));
    if (Radians(apart).degrees() >= kSameDirectionDegrees) continue;
    return absl::StrFormat("%s stands where %s does: lamps must be at least %g deg apart",
                           LampText(index, lamps[index]), LampText(i, lamps[i]),
                           kSameDirectionDegrees);
  }
  return {};
}

std::vector<LampGeometry> ParseLamps(const TomlTable& brace) {
  std::vector<LampGeometry> lamps;
  int ways = brace.Has("semicircle") + brace.Has("tilts_deg") + brace.Has("lamp");
  if (ways != 1) {
    brace.ErrorAt("",
                  absl::StrFormat("has %d of semicircle, tilts_deg and [[geometry.brace.lamp]]: "
                                  "exactly one must say where the lamps are",
                                  ways));
    brace.Ignore();
    return lamps;
  }
  if (brace.Has("lamp")) {
    for (const TomlTable& lamp : brace.Tables("lamp")) {
      lamps.push_back({WrapTurn(Degrees(lamp.Double("azimuth_deg", -360, 360))),
                       Degrees(lamp.Double("tilt_deg", 0, 180))});
      if (lamps.size() > kMostLamps) {
        lamp.ErrorAt("",
                     absl::StrFormat("one too many: at most %d lamps are possible", kMostLamps));
        break;
      }
      std::string wrong = SameDirection(lamps, lamps.size() - 1);
      if (!wrong.empty()) lamp.ErrorAt("", wrong);
    }
    return lamps;
  }
  Angle azimuth = Degrees(brace.Double("azimuth_deg", -360, 360, 0));
  if (brace.Has("semicircle")) {
    int count = static_cast<int>(brace.Int("semicircle", 1, kMostLamps));
    for (int i = 0; i < count; ++i) {
      lamps.push_back(OnBrace(azimuth, -90 + 180 * (i + 0.5) / count));
    }
    return lamps;
  }
  for (double tilt : brace.Doubles("tilts_deg", -180, 180)) {
    lamps.push_back(OnBrace(azimuth, tilt));
  }
  if (lamps.empty() || lamps.size() > kMostLamps) {
    brace.ErrorAt("tilts_deg",
                  absl::StrFormat("has %d elements, must have 1 to %d", lamps.size(), kMostLamps));
    return lamps;
  }
  for (size_t i = 1; i < lamps.size(); ++i) {
    std::string wrong = SameDirection(lamps, i);
    if (wrong.empty()) continue;
    brace.ErrorAt("tilts_deg", wrong);
    break;
  }
  return lamps;
}

BraceGeometry ParseBrace(const TomlTable& table) {
  BraceGeometry brace;
  brace.radius = Meters(table.Double("radius_m", 0.01, 100));
  brace.lamp_radius = Meters(table.Double("lamp_radius_m", 0.0001, 10));
  if (brace.lamp_radius.meters() > brace.radius.meters() / 2) {
    table.ErrorAt("lamp_radius_m",
                  absl::StrFormat("is %g, must be at most half of radius_m (%g)",
                                  brace.lamp_radius.meters(), brace.radius.meters()));
  }
  brace.lamps = ParseLamps(table);
  return brace;
}

ProjectorGeometry ParseProjector(const TomlTable& table) {
  ProjectorGeometry projector;
  projector.present = true;
  projector.distance = Meters(table.Double("distance_m", 0.01, 100));
  projector.azimuth = Degrees(table.Double("azimuth_deg", -360, 360, 0));
  projector.field_of_view = Degrees(table.Double("field_of_view_deg", 0.1, 170));
  projector.width = static_cast<int>(table.Int("width", 1, 16384));
  projector.height = static_cast<int>(table.Int("height", 1, 16384));
  return projector;
}

CameraGeometry ParseCamera(const TomlTable& table) {
  auto point = [&](std::string_view key, std::optional<std::vector<double>> fallback) -> Vec3 {
    std::vector<double> p = table.Doubles(key, -100, 100, 3, std::move(fallback));
    return {p[0], p[1], p[2]};
  };
  CameraGeometry camera;
  camera.position = point("position_m", {});
  camera.look_at = point("look_at_m", std::vector<double>{0, 0, 0});
  camera.field_of_view = Degrees(table.Double("field_of_view_deg", 0.1, 170));
  if (table.Has("position_m") && (camera.position - camera.look_at).norm() < 1e-3) {
    table.ErrorAt("position_m", "is where look_at_m is; they must be at least 0.001 m apart");
  }
  return camera;
}

}  // namespace

RigGeometry ParseGeometry(const TomlTable& geometry) {
  RigGeometry result;
  result.camera = ParseCamera(geometry.Table("camera", /*required=*/true));
  if (geometry.Has("brace")) result.brace = ParseBrace(geometry.Table("brace"));
  if (geometry.Has("projector")) result.projector = ParseProjector(geometry.Table("projector"));
  return result;
}

}  // namespace lightstage
