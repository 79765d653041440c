// Scenes by name or from a file.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/env.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// A scene that comes with the simulator.
struct ShippedScene {
  std::string name;
  std::string what;  // a phrase for people
};
const std::vector<ShippedScene>& ShippedScenes();

// Whether LoadScene may find it: a shipped scene's name, or what could be a scene file's path.
bool IsSceneName(const std::string& scene);

// A shipped scene's name, or the path of a scene file (scene_file.h), which ends with .toml and is relative to `directory`.
// NOT_FOUND / SCENE naming the known ones; the file's own errors.
absl::StatusOr<SceneDescription> LoadScene(const std::string& scene, const std::string& directory,
                                           Env& env = PosixEnv());

}  // namespace lightstage::sim
