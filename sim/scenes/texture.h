// Textures from picture files.
#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "base/env.h"
#include "optics/image.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// The colours of a picture: PNG, whose values are taken as sRGB, or OpenEXR (.exr), which is linear. 3 channels, clipped to [0,1].
// INVALID_ARGUMENT / TEXTURE naming the file; its reading's own errors.
absl::StatusOr<Image> ReadTexture(const std::string& path, Env& env = PosixEnv());

// Bilinear between the texels' middles, repeated; (0, 0) is the picture's lower left corner.
Rgb Lookup(const Image& picture, const Vec2f& uv);

}  // namespace lightstage::sim
