// The scenes that come with the simulator. All procedural, about 20 cm across, on the turntable's top at z = 0.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// "default": a still life of diffuse, glossy and finely self-shadowing things on a wooden board.
const std::vector<std::string>& SceneNames();

// NOT_FOUND / SCENE naming the known ones.
absl::StatusOr<SceneDescription> MakeScene(const std::string& name);

}  // namespace lightstage::sim
