// What glass and media must not do: go round a place more than once, and of media, be where other ones or glass are.
#pragma once

#include <embree3/rtcore.h>

#include "absl/status/status.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// As Scene::Build says, of what CheckScene has found good.
absl::Status CheckFilled(const SceneDescription& description, RTCDevice device);

}  // namespace lightstage::sim
