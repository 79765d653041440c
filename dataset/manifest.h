// The manifest of a finished capture: everything a reader needs to use the images without the daemon (docs/DATASET.md).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "base/env.h"
#include "dataset/shot.h"
#include "optics/rig_geometry.h"

namespace lightstage {

constexpr char kManifestFile[] = "manifest.json";
constexpr int kDatasetVersion = 1;

struct Manifest {
  std::string run_id;
  std::string name;  // given by the user
  std::string rig_name;
  std::string created_at;  // RFC 3339, UTC
  RigGeometry geometry;
  std::string plan_json;  // the plan as the API's canonical JSON: an object
  int width = 0, height = 0;
  int channels = 0;  // 1 or 3
  std::string compression;
  std::vector<ShotRecord> shots;  // by id, ascending
};

// INVALID_ARGUMENT / JSON_INVALID if plan_json is not JSON.
absl::StatusOr<std::string> ManifestToJson(const Manifest& manifest);

// `name` stands in messages. DATA_LOSS / MANIFEST_CORRUPT naming file and place if it is not a manifest of this version.
absl::StatusOr<Manifest> ManifestFromJson(std::string_view text, std::string_view name);

// Reads `folder`/manifest.json.
absl::StatusOr<Manifest> ReadManifest(const std::string& folder, Env& env = PosixEnv());

}  // namespace lightstage
