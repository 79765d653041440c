// What a scene must be before Embree sees it.
#pragma once

#include "absl/status/status.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// As Scene::Build says.
absl::Status CheckScene(const SceneDescription& description);

}  // namespace lightstage::sim
