// A shot: one illumination condition at one pose, taken with one exposure bracket. Its record: what became of it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/units.h"
#include "optics/pattern.h"
#include "optics/rig_geometry.h"

namespace lightstage {

enum class ShotKind {
  kBasis,      // a basis image
  kDark,       // all light off: what the camera sees by itself, and ambient light
  kReference,  // all lamps (or the full pattern) on: drift of light, camera or object shows here
};

struct LampLevel {
  int lamp = 0;      // index on the brace
  double level = 0;  // [0, 1] of full power
  bool operator==(const LampLevel&) const = default;
};

// One state of the lights. Lamps not named are dark; no pattern is a black one.
struct Condition {
  std::vector<LampLevel> lamps;
  std::optional<Pattern> pattern;
  bool operator==(const Condition&) const = default;
};

struct Shot {
  uint64_t id = 0;  // position in the program's order, from 0, without gaps
  ShotKind kind = ShotKind::kBasis;
  Pose pose;
  Condition condition;
  std::vector<Duration> exposures;  // the bracket, ascending, at least one
};

// One exposure as the camera reported it.
struct ExposureRecord {
  Duration requested{};
  Duration used{};
  double gain_db = 0;
  TimePoint start{}, end{};         // rig clock, as well as the driver can tell
  int64_t device_timestamp_ns = 0;  // the camera's own clock
  uint64_t frame_sequence = 0;      // the camera's own count
};

// Results of develop's checks on one basis image; shares are of all pixels, [0,1].
struct ShotChecks {
  double saturated_share = 0;  // above the range of every exposure
  double black_share = 0;      // below the range of every exposure
  double mean = 0;             // of the valid pixels' channels, linear units
  double maximum = 0;
  bool nothing_seen =
      false;  // light was commanded but the image is not brighter than dark (the camera may hide the lamp)
};

// What is journalled about a stored shot, and stands in the manifest.
struct ShotRecord {
  Shot shot;           // as commanded
  Pose reported_pose;  // as the axes reported it when the first exposure started
  TimePoint lit_at{};  // when the light had confirmed, rig clock; 0: not known (older runs)
  std::optional<Vec3>
      direction;  // object frame, unit, towards the light; absent for dark and reference shots
  std::vector<ExposureRecord> exposures;
  ShotChecks checks;
  int attempts = 1;
  std::string captured_at;  // RFC 3339, UTC, start of the first exposure
  std::string file;         // relative to the run's folder
  uint64_t bytes = 0;
  std::string sha256;  // lower-case hex of the whole file
};

const char* ShotKindName(ShotKind kind);  // "basis", "dark", "reference"
absl::StatusOr<ShotKind> ParseShotKind(std::string_view name);

// What a shot is, for people: "shot 12 (basis): lamp 7 at 0.5, azimuth 45, tilt 0".
std::string DescribeShot(const Shot& shot);

}  // namespace lightstage
