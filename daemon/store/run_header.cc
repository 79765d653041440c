#include "daemon/store/run_header.h"

#include "base/status.h"
#include "dataset/record_json.h"

namespace lightstage {
namespace {

constexpr char kFormat[] = "lightstage-run";
constexpr int kVersion = 1;

}  // namespace

absl::StatusOr<std::string> RunHeaderToJson(const RunHeader& h) {
  ASSIGN_OR_RETURN(Json plan, ParseJson(h.plan_json, "the run's plan"));
  Json json = {{"format", kFormat},
               {"version", kVersion},
               {"run", h.id},
               {"name", h.name},
               {"created_at", h.created_at},
               {"rig", h.rig_name},
               {"image",
                {{"width", h.width},
                 {"height", h.height},
                 {"channels", h.channels},
                 {"compression", h.compression}}},
               {"expected_shots", h.expected_shots},
               {"geometry", ToJson(h.geometry)},
               {"plan", std::move(plan)}};
  return json.dump(1) + "\n";
}

absl::StatusOr<RunHeader> RunHeaderFromJson(std::string_view text, std::string_view name) {
  auto corrupt = [&](const absl::Status& why) {
    return Error(absl::StatusCode::kDataLoss, "RUN_FILE_CORRUPT", std::string(why.message()),
                 {{"file", std::string(name)}});
  };
  auto json = ParseJson(text, name);
  if (!json.ok()) return corrupt(json.status());
  JsonReader reader(*json, std::string(name));
  if (reader.String("format") != kFormat) {
    reader.ErrorAt("format", absl::StrCat("must be '", kFormat, "'"));
  }
  reader.Int("version", kVersion, kVersion);
  RunHeader h;
  h.id = reader.String("run");
  h.name = reader.String("name");
  h.created_at = reader.String("created_at");
  h.rig_name = reader.String("rig");
  JsonReader image = reader.Object("image");
  h.width = static_cast<int>(image.Int("width", 1, 1 << 16));
  h.height = static_cast<int>(image.Int("height", 1, 1 << 16));
  h.channels = static_cast<int>(image.Int("channels", 1, 3));
  h.compression = image.String("compression");
  h.expected_shots = reader.Uint("expected_shots");
  h.geometry = ReadRigGeometry(reader.Object("geometry"));
  h.plan_json = reader.Value("plan").dump();
  if (!reader.status().ok()) return corrupt(reader.status());
  return h;
}

}  // namespace lightstage
