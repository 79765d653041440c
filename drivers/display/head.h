#pragma once

#include <cstdint>
#include <string>

namespace lightstage {

// An output that shows something: a part of the X screen, or what the kernel was given for it (kms_card.h).
struct Head {
  std::string name;
  int x = 0, y = 0, width = 0, height = 0;
  double refresh_hz = 0;  // 0: not known
  bool preferred = true;  // the mode is the one that the output says it prefers, or it prefers none
  uint64_t output = 0, crtc = 0, mode = 0;
  int card = 0, place = 0;  // KMS: of /dev/dri/card0 …, and among its connected outputs
};

}  // namespace lightstage
