// What a scene must be before Embree sees it.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// For errors: its own name, or its number.
std::string NameOf(const Mesh& mesh, size_t index);

// As Scene::Build says.
absl::Status CheckScene(const SceneDescription& description);

}  // namespace lightstage::sim
