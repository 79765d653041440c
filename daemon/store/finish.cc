#include "daemon/store/finish.h"

#include <algorithm>

#include "base/status.h"
#include "dataset/light_positions.h"
#include "dataset/manifest.h"

namespace lightstage {

absl::Status Finish(const RunFolder& run) {
  RETURN_IF_ERROR(run.CheckImages());
  const RunHeader& header = run.header();
  Manifest manifest;
  manifest.run_id = header.id;
  manifest.name = header.name;
  manifest.rig_name = header.rig_name;
  manifest.created_at = header.created_at;
  manifest.geometry = header.geometry;
  manifest.plan_json = header.plan_json;
  manifest.width = header.width;
  manifest.height = header.height;
  manifest.channels = header.channels;
  manifest.compression = header.compression;
  manifest.shots = run.Records(0, UINT64_MAX);
  std::sort(manifest.shots.begin(), manifest.shots.end(),
            [](const ShotRecord& a, const ShotRecord& b) { return a.shot.id < b.shot.id; });

  Env& env = run.env();
  std::vector<std::string> lights = WriteLightPositions(manifest.shots, header.geometry.camera);
  for (size_t i = 0; i < lights.size(); ++i) {
    RETURN_IF_ERROR(env.WriteFile(absl::StrCat(run.path(), "/", LightFileName(i)), lights[i]));
  }
  ASSIGN_OR_RETURN(std::string json, ManifestToJson(manifest));
  RETURN_IF_ERROR(env.SyncDirectory(run.path()));  // the manifest stands for all that is before it
  RETURN_IF_ERROR(env.WriteFile(absl::StrCat(run.path(), "/", kManifestFile), json));
  return env.SyncDirectory(run.path());
}

}  // namespace lightstage
