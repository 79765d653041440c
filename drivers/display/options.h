// What a rig file's projector table with driver = "display" says, as values.
#pragma once

#include "base/clock.h"
#include "base/toml.h"
#include "drivers/display/screen.h"

namespace lightstage {

struct DisplayOptions {
  ScreenOptions screen;
  double gamma = 1;   // of the projector: its light is (code / 255) ^ gamma
  Duration settle{};  // from the last confirmed frame until the light is right
};

// Reads the projector's table strictly; errors go into the table.
DisplayOptions ParseDisplayOptions(const TomlTable& table);

}  // namespace lightstage
