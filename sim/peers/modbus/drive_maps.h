// The registers of the drives that drive_peer.h can be, from their makers' manuals (drivers/modbus/README.md names them). On purpose not the
// driver's profiles: what is wrong in one of the two shows.
#pragma once

#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

namespace lightstage::sim {

enum class DriveAction { kMove, kHome, kHalt, kClear, kEnable, kZero };

// Writing `value` to `address` does `action`, if the registers of `needs` hold these values.
struct DriveTrigger {
  int address;
  uint16_t value;
  DriveAction action;
  std::vector<std::pair<int, uint16_t>> needs = {};
};

struct DriveMap {
  std::string_view kind;
  bool low_first = false;
  // To be read. Long numbers take two registers.
  int position = 0;
  int status = 0;
  int fault = 0, fault_words = 1;
  int serial = -1;
  std::vector<int> zeros;  // read as 0
  // Bits of the status.
  uint16_t moving = 0, standing = 0, in_position = 0, faulty = 0, homed = 0, homing = 0,
           enabled = 0;
  // To be written.
  std::vector<std::pair<int, int>> writable;  // first, last
  int target = 0;
  int velocity = 0, velocity_words = 1;
  int acceleration = 0, acceleration_words = 1;
  double (*steps_per_s)(double value, double steps_per_rev) = nullptr;
  double (*steps_per_s2)(double value, double steps_per_rev) = nullptr;
  std::vector<DriveTrigger> triggers;
  bool on_edge = false;  // the input command's bits act when they come on
  bool enabled_at_start = false;
  bool home_zeroes = true;  // homing makes the position 0
  bool move_clears_homed = false;
};

const std::vector<DriveMap>& DriveMaps();

}  // namespace lightstage::sim
