#include "daemon/capture/limits.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

absl::Status Invalid(std::string_view reason, std::string_view message,
                     const ErrorMetadata& metadata) {
  return Error(absl::StatusCode::kInvalidArgument, reason, message, metadata);
}

std::string Microseconds(Duration d) {
  return absl::StrCat(std::chrono::duration<double, std::micro>(d).count());
}

// `name` is "azimuth" or "tilt", `device` what turns it.
absl::Status CheckAngle(std::string_view name, std::string_view device, std::string_view reason,
                        Angle angle, Angle min, Angle max, const std::optional<AxisInfo>& axis) {
  double degrees = angle.degrees();
  // Built only where something is wrong: this runs for every shot of a plan.
  auto metadata = [&] {
    return ErrorMetadata{{absl::StrCat(name, "_deg"), absl::StrCat(degrees)}};
  };
  if (!std::isfinite(degrees)) {
    return Invalid("ANGLE_NOT_FINITE",
                   absl::StrFormat("%s %g is not a finite number of degrees", name, degrees),
                   metadata());
  }
  if (!axis) {
    if (degrees == 0) return absl::OkStatus();
    return Invalid("AXIS_MISSING",
                   absl::StrFormat("%s %g deg: this rig has no %s, only %s 0 is possible", name,
                                   degrees, device, name),
                   metadata());
  }
  if (angle < min || angle > max) {
    ErrorMetadata limits = metadata();
    limits.emplace_back("min_deg", absl::StrCat(min.degrees()));
    limits.emplace_back("max_deg", absl::StrCat(max.degrees()));
    return Invalid(reason,
                   absl::StrFormat("%s %g deg is outside the rig's limits [%g, %g] deg", name,
                                   degrees, min.degrees(), max.degrees()),
                   limits);
  }
  absl::Status reachable = CheckTarget(*axis, angle);
  if (reachable.ok()) return reachable;
  return Invalid("AXIS_LIMIT", std::string(reachable.message()), ErrorMetadataOf(reachable));
}

absl::Status CheckLampLevels(const std::vector<LampLevel>& lamps, const RigFacts& facts) {
  if (lamps.empty()) return absl::OkStatus();
  if (!facts.lamps) {
    return Invalid("LAMPS_MISSING",
                   absl::StrFormat("lamp %d: this rig has no lamps", lamps[0].lamp),
                   {{"lamp", absl::StrCat(lamps[0].lamp)}});
  }
  int count = facts.lamps->count, on = 0;
  std::vector<int> seen;
  for (const LampLevel& lamp : lamps) {
    if (lamp.lamp < 0 || lamp.lamp >= count) {
      return Invalid("LAMP_UNKNOWN",
                     absl::StrFormat("lamp %d does not exist: this rig has %d lamps, 0 to %d",
                                     lamp.lamp, count, count - 1),
                     {{"lamp", absl::StrCat(lamp.lamp)}, {"lamps", absl::StrCat(count)}});
    }
    if (!(lamp.level >= 0 && lamp.level <= 1)) {
      return Invalid(
          "LAMP_LEVEL",
          absl::StrFormat("lamp %d: level %.10g is outside [0, 1]", lamp.lamp, lamp.level),
          {{"lamp", absl::StrCat(lamp.lamp)}, {"level", absl::StrCat(lamp.level)}});
    }
    // Half a step rounds up, as the devices' std::round does.
    if (int steps = facts.lamps->steps; lamp.level > 0 && steps > 0 && lamp.level * steps < 0.5) {
      return Invalid("LAMP_LEVEL",
                     absl::StrFormat("lamp %d: level %g is dark on these lamps, which have %d "
                                     "steps: at least %.4g, or 0",
                                     lamp.lamp, lamp.level, steps, 0.5 / steps),
                     {{"lamp", absl::StrCat(lamp.lamp)}, {"level", absl::StrCat(lamp.level)}});
    }
    on += lamp.level > 0;
    seen.push_back(lamp.lamp);
  }
  std::sort(seen.begin(), seen.end());
  auto twice = std::adjacent_find(seen.begin(), seen.end());
  if (twice != seen.end()) {
    return Invalid("LAMP_DUPLICATE", absl::StrFormat("lamp %d is named twice", *twice),
                   {{"lamp", absl::StrCat(*twice)}});
  }
  if (on > facts.limits.max_lamps_on) {
    return Invalid(
        "LAMPS_ON_LIMIT",
        absl::StrFormat("%d lamps on at once: this rig allows %d", on, facts.limits.max_lamps_on),
        {{"lamps_on", absl::StrCat(on)},
         {"max_lamps_on", absl::StrCat(facts.limits.max_lamps_on)}});
  }
  return absl::OkStatus();
}

absl::Status CheckPattern(const Pattern& pattern, const RigFacts& facts) {
  if (!facts.projector) {
    return Invalid("PROJECTOR_MISSING",
                   absl::StrCat("pattern ", PatternName(pattern), ": this rig has no projector"),
                   {{"pattern", PatternName(pattern)}});
  }
  RETURN_IF_ERROR(Validate(pattern));
  int width = facts.projector->width, height = facts.projector->height;
  if (pattern.grid > std::min(width, height)) {
    return Invalid("GRID_TOO_FINE",
                   absl::StrFormat("grid %d is finer than the projector's %d x %d pixels",
                                   pattern.grid, width, height),
                   {{"grid", absl::StrCat(pattern.grid)},
                    {"width", absl::StrCat(width)},
                    {"height", absl::StrCat(height)}});
  }
  return absl::OkStatus();
}

absl::Status CameraRefuses(Duration exposure, const ExposureResult& result, const RigFacts& facts) {
  std::string value = Microseconds(exposure);
  std::string least = Microseconds(facts.camera.min_exposure);
  std::string most = Microseconds(facts.camera.max_exposure);
  return Invalid(
      "CAMERA_EXPOSURE",
      absl::StrCat("exposure ", value, " us: ", result.note, "; the camera takes ", least, " to ",
                   most, " us"),
      {{"exposure_us", value}, {"note", result.note}, {"min_us", least}, {"max_us", most}});
}

}  // namespace

absl::Status CheckPose(const Pose& pose, const RigFacts& facts) {
  const LimitOptions& limits = facts.limits;
  RETURN_IF_ERROR(CheckAngle("azimuth", "turntable", "AZIMUTH_LIMIT", pose.azimuth,
                             limits.azimuth_min, limits.azimuth_max, facts.turntable));
  return CheckAngle("tilt", "tilt axis", "TILT_LIMIT", pose.tilt, limits.tilt_min, limits.tilt_max,
                    facts.tilt);
}

absl::Status CheckCondition(const Condition& condition, const RigFacts& facts) {
  RETURN_IF_ERROR(CheckLampLevels(condition.lamps, facts));
  return condition.pattern ? CheckPattern(*condition.pattern, facts) : absl::OkStatus();
}

absl::Status CheckExposures(const std::vector<Duration>& exposures, const RigFacts& facts) {
  if (exposures.empty()) return Invalid("EXPOSURES_EMPTY", "no exposure time is given", {});
  const LimitOptions& limits = facts.limits;
  if (exposures.size() > static_cast<size_t>(limits.max_exposures_per_shot)) {
    return Invalid("EXPOSURES_TOO_MANY",
                   absl::StrFormat("%d exposures per shot: this rig allows %d", exposures.size(),
                                   limits.max_exposures_per_shot),
                   {{"exposures", absl::StrCat(exposures.size())},
                    {"max_exposures_per_shot", absl::StrCat(limits.max_exposures_per_shot)}});
  }
  Duration before{};
  for (Duration exposure : exposures) {
    if (exposure <= before) {
      return Invalid(
          "EXPOSURES_NOT_ASCENDING",
          absl::StrCat("exposure ", Microseconds(exposure), " us follows ", Microseconds(before),
                       " us: exposures must be above 0 and ascending"),
          {{"exposure_us", Microseconds(exposure)}, {"before_us", Microseconds(before)}});
    }
    before = exposure;
    if (exposure > limits.max_exposure) {
      std::string most = Microseconds(limits.max_exposure);
      return Invalid("EXPOSURE_LIMIT",
                     absl::StrCat("exposure ", Microseconds(exposure),
                                  " us: this rig allows at most ", most, " us"),
                     {{"exposure_us", Microseconds(exposure)}, {"max_exposure_us", most}});
    }
    ExposureResult result = facts.validate_exposure(exposure);
    if (result.verdict == ConfigVerdict::kInvalid) return CameraRefuses(exposure, result, facts);
  }
  return absl::OkStatus();
}

absl::Status CheckShot(const Shot& shot, const RigFacts& facts) {
  absl::Status status = CheckPose(shot.pose, facts);
  if (status.ok()) status = CheckCondition(shot.condition, facts);
  if (status.ok()) status = CheckExposures(shot.exposures, facts);
  return status.ok() ? status : Annotate(status, absl::StrCat("shot ", shot.id));
}

}  // namespace lightstage
