// Scene files: what stands on the turntable, in TOML, read as strictly as the rig file. docs/SCENEFILE.md has every key.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "base/env.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// INVALID_ARGUMENT / SCENE_FILE_INVALID with "file:line:column: …"; the errors of the meshes and textures that it names, which are
// relative to its own directory.
absl::StatusOr<SceneDescription> ReadSceneFile(const std::string& path, Env& env = PosixEnv());

}  // namespace lightstage::sim
