// What a rig file's projector table with driver = "dlpc350" says, as values.
#pragma once

#include <array>
#include <map>
#include <string>

#include "base/toml.h"
#include "drivers/dlpc350/codec.h"
#include "optics/pattern.h"

namespace lightstage::dlpc350 {

// Where in the flash a pattern is.
struct StoredPattern {
  int image = 0;  // its index
  int number =
      0;  // the first of its bit planes, in units of `depth`; 24 at depth 1: white without any image
  int depth = 1;
  bool invert = false;
};

struct Options {
  bool flash = false;                // else video
  std::string path, serial;          // empty: any, so that there may be one only
  std::array<uint8_t, 3> current{};  // of red, green, blue; 0 none, 255 all that the board gives
  Duration settle{};
  // Flash only.
  int leds = 7;
  uint32_t exposure_us = 0, period_us = 0;
  int trigger_in = 0;  // as LutEntry::trigger
  double trigger_in_delay_us = 0;
  std::array<uint8_t, 3> trigger_out1{};  // inverted, delay of the rising edge, of the falling one
  std::array<uint8_t, 2> trigger_out2{};  // without the falling one
  std::map<Pattern, StoredPattern> patterns;  // by Canonical()
};

// The pattern without the fields that make no difference to its arrangement.
Pattern Canonical(Pattern pattern);

// Reads the projector's table strictly, except the sub-table "display"; errors go into the table.
Options ParseOptions(const TomlTable& table);

}  // namespace lightstage::dlpc350
