#pragma once

#include <array>
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
  // What the X server does to its part of the screen on the way (AlterationOf); empty: nothing.
  std::string altered{};
  int card = 0, place = 0;  // KMS: of /dev/dri/card0 …, and among its connected outputs
};

// How RandR has an output scan out its part of the screen.
struct Scanout {
  int width = 0, height = 0;            // of the part of the screen
  int mode_width = 0, mode_height = 0;  // that the output is given
  int rotation = 1;                     // RandR's bits; 1: none, and no reflection
  std::array<int32_t, 9> transform{};   // 16.16, by rows
};
// Empty if every pixel of the screen is one of the output's, where it stands: else what comes between.
std::string AlterationOf(const Scanout& scanout);

}  // namespace lightstage
