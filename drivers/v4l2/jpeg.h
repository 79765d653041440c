// Pictures of Motion JPEG. Pure.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "drivers/api/camera.h"

namespace lightstage {

// False if libjpeg-turbo was missing when this was built (no_jpeg.cc).
bool CanDecodeJpeg();

// The picture as kMono8, which is its luma, or kRGB8. DATA_LOSS / FRAME_INCOMPLETE unless the bytes are one whole and undamaged picture of that
// size: what the library only warns of counts too, for it makes up what is missing.
absl::StatusOr<std::vector<std::byte>> DecodeJpeg(std::span<const std::byte> bytes, int width,
                                                  int height, PixelFormat format);

}  // namespace lightstage
