// What real lenses do to a picture: the projector's output as it leaves its lens, and the camera's light as it arrives on the chip.
#pragma once

#include "optics/image.h"
#include "sim/rig/options.h"

namespace lightstage::sim {

// What the projector's pixels send when they are told to show `raster` (1 channel, [0,1]), relative to white on the axis: its response
// curve, black that is not dark, and less light towards the corners.
Image Emitted(Image raster, const ProjectorOptics& optics);

// Light towards the corners is lost, and what comes through the lens is spread by a Gaussian. Any number of channels. All cores work.
void PassLens(const CameraLens& lens, Image* image);

}  // namespace lightstage::sim
