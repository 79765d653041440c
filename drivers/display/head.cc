#include "drivers/display/head.h"

#include "absl/strings/str_format.h"

namespace lightstage {

std::string AlterationOf(const Scanout& s) {
  if (s.rotation != 1) return "rotated or reflected";
  // Of a projective transform only the ratio counts; nobody sets the identity otherwise than as this.
  constexpr int32_t kOne = 1 << 16;
  if (s.transform != std::array<int32_t, 9>{kOne, 0, 0, 0, kOne, 0, 0, 0, kOne}) {
    return "scaled or transformed";
  }
  if (s.width != s.mode_width || s.height != s.mode_height) {
    return absl::StrFormat("scaled from %dx%d to %dx%d", s.width, s.height, s.mode_width,
                           s.mode_height);
  }
  return "";
}

}  // namespace lightstage
