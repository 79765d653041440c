#include "dataset/record_json.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/status.h"

namespace lightstage {
namespace {

constexpr int kMostLamps = 65536;
constexpr int kMostPixels = 65536;

constexpr std::array<std::pair<PatternArrangement, const char*>, 5> kArrangements = {{
    {PatternArrangement::kBlack, "black"},
    {PatternArrangement::kFull, "full"},
    {PatternArrangement::kSquare, "square"},
    {PatternArrangement::kHorizontal, "horizontal"},
    {PatternArrangement::kVertical, "vertical"},
}};

constexpr std::array<std::pair<PatternProfile, const char*>, 3> kProfiles = {{
    {PatternProfile::kBox, "box"},
    {PatternProfile::kGaussian, "gaussian"},
    {PatternProfile::kHat, "hat"},
}};

template <class Enum, size_t N>
const char* NameOf(const std::array<std::pair<Enum, const char*>, N>& names, Enum value) {
  for (const auto& [candidate, name] : names) {
    if (candidate == value) return name;
  }
  return "?";
}

template <class Enum, size_t N>
Enum ReadEnum(const JsonReader& reader, const char* key,
              const std::array<std::pair<Enum, const char*>, N>& names) {
  std::string given = reader.String(key);
  std::string known;
  for (const auto& [value, name] : names) {
    if (given == name) return value;
    absl::StrAppend(&known, known.empty() ? "" : ", ", name);
  }
  reader.ErrorAt(key, absl::StrCat("is '", given, "', must be one of ", known));
  return names[0].first;
}

double Microseconds(Duration d) { return static_cast<double>(d.count()) / 1e3; }

Duration ReadMicroseconds(const JsonReader& reader, const char* key) {
  return Duration(std::llround(reader.Double(key, 0, 1e12) * 1e3));
}

Json ToJson(const Pattern& p) {
  return {{"arrangement", NameOf(kArrangements, p.arrangement)},
          {"profile", NameOf(kProfiles, p.profile)},
          {"grid", p.grid},
          {"influence", p.influence},
          {"column", p.column},
          {"row", p.row}};
}

Pattern ReadPattern(const JsonReader& reader) {
  Pattern p;
  p.arrangement = ReadEnum(reader, "arrangement", kArrangements);
  p.profile = ReadEnum(reader, "profile", kProfiles);
  p.grid = static_cast<int>(reader.Int("grid", 1, 1024));
  p.influence = static_cast<int>(reader.Int("influence", 0, 1023));
  p.column = static_cast<int>(reader.Int("column", 0, 1023));
  p.row = static_cast<int>(reader.Int("row", 0, 1023));
  return p;
}

Json ToJson(const ExposureRecord& e) {
  return {{"requested_us", Microseconds(e.requested)},
          {"used_us", Microseconds(e.used)},
          {"gain_db", e.gain_db},
          {"start_ns", e.start.time_since_epoch().count()},
          {"end_ns", e.end.time_since_epoch().count()},
          {"device_timestamp_ns", e.device_timestamp_ns},
          {"frame", e.frame_sequence}};
}

ExposureRecord ReadExposure(const JsonReader& reader) {
  ExposureRecord e;
  e.requested = ReadMicroseconds(reader, "requested_us");
  e.used = ReadMicroseconds(reader, "used_us");
  e.gain_db = reader.Double("gain_db");
  e.start = TimePoint(Duration(reader.Int("start_ns")));
  e.end = TimePoint(Duration(reader.Int("end_ns")));
  e.device_timestamp_ns = reader.Int("device_timestamp_ns");
  e.frame_sequence = reader.Uint("frame");
  return e;
}

Json ToJson(const ShotChecks& c) {
  return {{"saturated_share", c.saturated_share},
          {"black_share", c.black_share},
          {"mean", c.mean},
          {"maximum", c.maximum},
          {"nothing_seen", c.nothing_seen}};
}

ShotChecks ReadChecks(const JsonReader& reader) {
  ShotChecks c;
  c.saturated_share = reader.Double("saturated_share", 0, 1);
  c.black_share = reader.Double("black_share", 0, 1);
  c.mean = reader.Double("mean");
  c.maximum = reader.Double("maximum");
  c.nothing_seen = reader.Bool("nothing_seen");
  return c;
}

Vec3 ReadVec3(const JsonReader& reader, const char* key) {
  std::vector<double> v = reader.Doubles(key, 3);
  return {v[0], v[1], v[2]};
}

Length ReadLength(const JsonReader& reader, const char* key) {
  return Meters(reader.Double(key, 0, 1e6));
}

}  // namespace

Json ToJson(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json ToJson(const Pose& pose) {
  return {{"azimuth_deg", pose.azimuth.degrees()}, {"tilt_deg", pose.tilt.degrees()}};
}

Json ToJson(const Condition& condition) {
  Json lamps = Json::array();
  for (const LampLevel& l : condition.lamps)
    lamps.push_back({{"lamp", l.lamp}, {"level", l.level}});
  Json json = {{"lamps", std::move(lamps)}};
  if (condition.pattern) json["pattern"] = ToJson(*condition.pattern);
  return json;
}

Json ToJson(const ShotRecord& r) {
  Json bracket = Json::array();
  for (Duration d : r.shot.exposures) bracket.push_back(Microseconds(d));
  Json exposures = Json::array();
  for (const ExposureRecord& e : r.exposures) exposures.push_back(ToJson(e));
  Json json = {{"shot", r.shot.id},
               {"kind", ShotKindName(r.shot.kind)},
               {"commanded", ToJson(r.shot.pose)},
               {"reported", ToJson(r.reported_pose)},
               {"condition", ToJson(r.shot.condition)},
               {"lit_at_ns", r.lit_at.time_since_epoch().count()},
               {"bracket_us", std::move(bracket)}};
  if (r.direction) json["direction"] = ToJson(*r.direction);
  json["exposures"] = std::move(exposures);
  json["checks"] = ToJson(r.checks);
  json["attempts"] = r.attempts;
  json["captured_at"] = r.captured_at;
  json["file"] = r.file;
  json["bytes"] = r.bytes;
  json["sha256"] = r.sha256;
  return json;
}

Json ToJson(const RigGeometry& g) {
  Json lamps = Json::array();
  for (const LampGeometry& lamp : g.brace.lamps) {
    lamps.push_back({{"azimuth_deg", lamp.azimuth.degrees()}, {"tilt_deg", lamp.tilt.degrees()}});
  }
  Json json = {{"brace",
                {{"radius_m", g.brace.radius.meters()},
                 {"lamp_radius_m", g.brace.lamp_radius.meters()},
                 {"lamps", std::move(lamps)}}},
               {"camera",
                {{"position_m", ToJson(g.camera.position)},
                 {"look_at_m", ToJson(g.camera.look_at)},
                 {"field_of_view_deg", g.camera.field_of_view.degrees()}}}};
  if (g.projector.present) {
    json["projector"] = {{"distance_m", g.projector.distance.meters()},
                         {"azimuth_deg", g.projector.azimuth.degrees()},
                         {"field_of_view_deg", g.projector.field_of_view.degrees()},
                         {"width", g.projector.width},
                         {"height", g.projector.height}};
  }
  return json;
}

Pose ReadPose(const JsonReader& reader) {
  return {Degrees(reader.Double("azimuth_deg")), Degrees(reader.Double("tilt_deg"))};
}

Condition ReadCondition(const JsonReader& reader) {
  Condition condition;
  for (const JsonReader& lamp : reader.Objects("lamps")) {
    condition.lamps.push_back(
        {static_cast<int>(lamp.Int("lamp", 0, kMostLamps)), lamp.Double("level", 0, 1)});
  }
  if (reader.Has("pattern")) condition.pattern = ReadPattern(reader.Object("pattern"));
  return condition;
}

ShotRecord ReadShotRecord(const JsonReader& reader) {
  ShotRecord r;
  r.shot.id = reader.Uint("shot");
  auto kind = ParseShotKind(reader.String("kind"));
  if (kind.ok()) {
    r.shot.kind = *kind;
  } else {
    reader.ErrorAt("kind", std::string(kind.status().message()));
  }
  r.shot.pose = ReadPose(reader.Object("commanded"));
  r.reported_pose = ReadPose(reader.Object("reported"));
  if (reader.Has("lit_at_ns")) r.lit_at = TimePoint(Duration(reader.Int("lit_at_ns")));
  r.shot.condition = ReadCondition(reader.Object("condition"));
  const Json& bracket = reader.Value("bracket_us");
  for (double us : reader.Doubles("bracket_us", bracket.is_array() ? bracket.size() : 0)) {
    r.shot.exposures.push_back(Duration(std::llround(us * 1e3)));
  }
  if (reader.Has("direction")) r.direction = ReadVec3(reader, "direction");
  for (const JsonReader& exposure : reader.Objects("exposures")) {
    r.exposures.push_back(ReadExposure(exposure));
  }
  r.checks = ReadChecks(reader.Object("checks"));
  r.attempts = static_cast<int>(reader.Int("attempts", 1, 1000000));
  r.captured_at = reader.String("captured_at");
  r.file = reader.String("file");
  r.bytes = reader.Uint("bytes");
  r.sha256 = reader.String("sha256");
  return r;
}

RigGeometry ReadRigGeometry(const JsonReader& reader) {
  RigGeometry g;
  JsonReader brace = reader.Object("brace");
  g.brace.radius = ReadLength(brace, "radius_m");
  g.brace.lamp_radius = ReadLength(brace, "lamp_radius_m");
  for (const JsonReader& lamp : brace.Objects("lamps")) {
    Pose angles = ReadPose(lamp);
    g.brace.lamps.push_back({angles.azimuth, angles.tilt});
  }
  JsonReader camera = reader.Object("camera");
  g.camera.position = ReadVec3(camera, "position_m");
  g.camera.look_at = ReadVec3(camera, "look_at_m");
  g.camera.field_of_view = Degrees(camera.Double("field_of_view_deg", 0, 180));
  if (reader.Has("projector")) {
    JsonReader projector = reader.Object("projector");
    g.projector.present = true;
    g.projector.distance = ReadLength(projector, "distance_m");
    g.projector.azimuth = Degrees(projector.Double("azimuth_deg"));
    g.projector.field_of_view = Degrees(projector.Double("field_of_view_deg", 0, 180));
    g.projector.width = static_cast<int>(projector.Int("width", 1, kMostPixels));
    g.projector.height = static_cast<int>(projector.Int("height", 1, kMostPixels));
  }
  return g;
}

absl::StatusOr<Condition> ConditionFromJson(std::string_view text, std::string name) {
  ASSIGN_OR_RETURN(Json json, ParseJson(text, name));
  JsonReader reader(json, std::move(name));
  Condition condition = ReadCondition(reader);
  RETURN_IF_ERROR(reader.status());
  return condition;
}

}  // namespace lightstage
