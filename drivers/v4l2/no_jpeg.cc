// Takes jpeg.cc's place where libjpeg-turbo was missing when this was built: the rig file is refused before there is a picture.
#include "base/status.h"
#include "drivers/v4l2/jpeg.h"

namespace lightstage {

bool CanDecodeJpeg() { return false; }

absl::StatusOr<std::vector<std::byte>> DecodeJpeg(std::span<const std::byte>, int, int,
                                                  PixelFormat) {
  return Error(absl::StatusCode::kUnimplemented, "NOT_BUILT",
               "MJPG: this was built without libjpeg-turbo");
}

}  // namespace lightstage
