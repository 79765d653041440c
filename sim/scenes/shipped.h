// The scenes that come with the simulator, by what makes them. All procedural, about 20 cm across, on the turntable's top at z = 0.
#pragma once

#include "sim/render/scene.h"

namespace lightstage::sim {

SceneDescription StillLife();
SceneDescription Car();
SceneDescription Toys();
SceneDescription Chess();
SceneDescription Materials();
SceneDescription Balls();
SceneDescription Bowl();
SceneDescription Calibration();
SceneDescription Room();

}  // namespace lightstage::sim
