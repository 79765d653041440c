#include "dataset/manifest.h"

#include "base/status.h"
#include "dataset/record_json.h"

namespace lightstage {
namespace {

constexpr char kFormat[] = "lightstage-dataset";

absl::Status Corrupt(std::string_view name, const absl::Status& why) {
  return Error(absl::StatusCode::kDataLoss, "MANIFEST_CORRUPT", std::string(why.message()),
               {{"file", std::string(name)}});
}

}  // namespace

absl::StatusOr<std::string> ManifestToJson(const Manifest& m) {
  ASSIGN_OR_RETURN(Json plan, ParseJson(m.plan_json, "the run's plan"));
  Json head = {{"format", kFormat},
               {"version", kDatasetVersion},
               {"run", m.run_id},
               {"name", m.name},
               {"rig", m.rig_name},
               {"created_at", m.created_at},
               {"image",
                {{"width", m.width},
                 {"height", m.height},
                 {"channels", m.channels},
                 {"compression", m.compression}}},
               {"geometry", ToJson(m.geometry)},
               {"plan", std::move(plan)}};
  // Shots are appended one a line: 57 344 of them as one JSON tree would take a quarter of a gigabyte, and lines can be compared.
  std::string text = head.dump(1);
  text.resize(text.size() - 2);  // "\n}"
  text += ",\n \"shots\": [";
  const char* separator = "\n  ";
  for (const ShotRecord& shot : m.shots) {
    text += separator;
    text += ToJson(shot).dump();
    separator = ",\n  ";
  }
  text += "\n ]\n}\n";
  return text;
}

absl::StatusOr<Manifest> ManifestFromJson(std::string_view text, std::string_view name) {
  Manifest m;
  absl::Status shot_error;
  // Each shot is taken as it is parsed and leaves the tree, for the same reason.
  std::string top_key;
  auto take_shots = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::key && depth == 1) top_key = parsed.get<std::string>();
    if (event != Json::parse_event_t::object_end || depth != 2 || top_key != "shots") return true;
    JsonReader reader(parsed, absl::StrCat(name, ": shots[", m.shots.size(), "]"));
    m.shots.push_back(ReadShotRecord(reader));
    if (shot_error.ok()) shot_error = reader.status();
    return false;
  };
  Json json;
  try {
    json = Json::parse(text, take_shots);
  } catch (const nlohmann::json::exception& e) {
    return Corrupt(name, absl::InvalidArgumentError(absl::StrCat(name, ": ", e.what())));
  }
  JsonReader reader(json, std::string(name));
  std::string format = reader.String("format");
  if (reader.status().ok() && format != kFormat) {
    reader.ErrorAt("format", absl::StrCat("is '", format, "', must be '", kFormat, "'"));
  }
  reader.Int("version", kDatasetVersion, kDatasetVersion);
  m.run_id = reader.String("run");
  m.name = reader.String("name");
  m.rig_name = reader.String("rig");
  m.created_at = reader.String("created_at");
  JsonReader image = reader.Object("image");
  m.width = static_cast<int>(image.Int("width", 1, 1 << 16));
  m.height = static_cast<int>(image.Int("height", 1, 1 << 16));
  m.channels = static_cast<int>(image.Int("channels", 1, 3));
  m.compression = image.String("compression");
  m.geometry = ReadRigGeometry(reader.Object("geometry"));
  m.plan_json = reader.Value("plan").dump();
  if (!reader.Value("shots").is_array()) reader.ErrorAt("shots", "must be an array");
  if (!reader.status().ok()) return Corrupt(name, reader.status());
  if (!shot_error.ok()) return Corrupt(name, shot_error);
  for (size_t i = 1; i < m.shots.size(); ++i) {
    if (m.shots[i].shot.id <= m.shots[i - 1].shot.id) {
      return Corrupt(name, absl::InvalidArgumentError(
                               absl::StrCat(name, ": shots[", i, "].shot: is ", m.shots[i].shot.id,
                                            ", must be above the one before it")));
    }
  }
  return m;
}

absl::StatusOr<Manifest> ReadManifest(const std::string& folder, Env& env) {
  std::string path = absl::StrCat(folder, "/", kManifestFile);
  ASSIGN_OR_RETURN(std::string text, env.ReadFile(path));
  return ManifestFromJson(text, path);
}

}  // namespace lightstage
