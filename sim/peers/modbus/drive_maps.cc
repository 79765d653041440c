#include "sim/peers/modbus/drive_maps.h"

namespace lightstage::sim {
namespace {

double Same(double value, double) { return value; }

DriveMap OrientalMotorAz() {
  DriveMap map;
  map.kind = "oriental-motor-az";
  map.position = 0x00CC;
  map.status = 0x007F;
  map.zeros = {0x007E};
  map.moving = 1 << 13;
  map.in_position = 1 << 14;
  map.faulty = 1 << 7;
  map.homed = 1 << 4;
  map.enabled = 1 << 5;  // READY
  map.fault = 0x0080;
  map.fault_words = 2;
  map.writable = {{0x0058, 0x0067}, {0x007C, 0x007D}};
  map.target = 0x005C;
  map.velocity = 0x005E;
  map.velocity_words = 2;
  map.acceleration = 0x0060;
  map.acceleration_words = 2;
  map.steps_per_s = Same;
  map.steps_per_s2 = Same;  // 0.001 kHz/s
  map.triggers = {
      {0x0067, 1, DriveAction::kMove, {{0x0066, 0}, {0x005B, 1}, {0x0065, 1000}, {0x007D, 0}}},
      {0x007D, 1 << 4, DriveAction::kHome},
      {0x007D, 1 << 5, DriveAction::kHalt},
      {0x007D, 1 << 7, DriveAction::kClear}};
  map.on_edge = true;
  map.enabled_at_start = true;
  map.move_clears_homed = true;
  return map;
}

DriveMap LeadshineRs() {
  DriveMap map;
  map.kind = "leadshine-rs";
  map.position = 0x1014;
  map.status = 0x1003;
  map.faulty = 1 << 0;
  map.enabled = 1 << 1;
  map.moving = 1 << 2;
  map.standing = 1 << 4 | 1 << 5;  // command completed, path completed
  map.homed = 1 << 6;
  map.fault = 0x2203;
  map.writable = {{0x000F, 0x000F}, {0x1801, 0x1801}, {0x6002, 0x6002}, {0x6200, 0x6207}};
  map.target = 0x6201;
  map.velocity = 0x6203;
  map.acceleration = 0x6204;
  map.steps_per_s = [](double rpm, double rev) { return rpm / 60 * rev; };
  map.steps_per_s2 = [](double ms, double rev) { return 1000.0 / 60 * rev / (ms / 1000); };
  map.triggers = {{0x6207, 0x10, DriveAction::kMove, {{0x6200, 1}}},
                  {0x6002, 0x20, DriveAction::kHome},
                  {0x6002, 0x40, DriveAction::kHalt},
                  {0x1801, 0x1111, DriveAction::kClear},
                  {0x000F, 1, DriveAction::kEnable}};
  return map;
}

DriveMap AppliedMotion() {
  DriveMap map;
  map.kind = "applied-motion";
  constexpr int kFirst = 40001;
  map.fault = 40001 - kFirst;
  map.status = 40002 - kFirst;
  map.position = 40005 - kFirst;
  map.enabled = 0x0001;
  map.faulty = 0x0200;
  map.in_position = 0x0008;
  map.moving = 0x0010;
  map.homing = 0x0400;
  map.writable = {{40028 - kFirst, 40032 - kFirst}, {40125 - kFirst, 40130 - kFirst}};
  map.acceleration = 40028 - kFirst;
  map.velocity = 40030 - kFirst;
  map.target = 40031 - kFirst;
  map.steps_per_s = [](double value, double rev) { return value / 240 * rev; };
  map.steps_per_s2 = [](double value, double rev) { return value / 6 * rev; };
  constexpr int kOpcode = 40125 - kFirst;
  map.triggers = {{kOpcode, 0x67, DriveAction::kMove},
                  {kOpcode, 0x6E, DriveAction::kHome, {{kOpcode + 1, '3'}, {kOpcode + 2, 'L'}}},
                  {kOpcode, 0xE1, DriveAction::kHalt},
                  {kOpcode, 0xBA, DriveAction::kClear},
                  {kOpcode, 0x9F, DriveAction::kEnable},
                  {kOpcode, 0x98, DriveAction::kZero, {{kOpcode + 1, 0}, {kOpcode + 2, 0}}},
                  {kOpcode, 0xA5, DriveAction::kZero, {{kOpcode + 1, 0}, {kOpcode + 2, 0}}}};
  map.home_zeroes = false;
  return map;
}

DriveMap Generic(std::string_view kind, bool low_first) {
  DriveMap map;
  map.kind = kind;
  map.low_first = low_first;
  map.position = 0;
  map.status = 2;
  map.fault = 3;
  map.serial = 4;
  map.moving = 1;
  map.in_position = 2;
  map.homed = 4;
  map.faulty = 8;
  map.homing = 16;
  map.writable = {{16, 22}};
  map.target = 16;
  map.velocity = 18;
  map.velocity_words = 2;
  map.acceleration = 20;
  map.acceleration_words = 2;
  map.steps_per_s = Same;
  map.steps_per_s2 = Same;
  map.triggers = {{22, 1, DriveAction::kMove},
                  {22, 2, DriveAction::kHome},
                  {22, 3, DriveAction::kHalt},
                  {22, 4, DriveAction::kClear},
                  {22, 5, DriveAction::kEnable}};
  return map;
}

}  // namespace

const std::vector<DriveMap>& DriveMaps() {
  static const auto* const maps =
      new std::vector<DriveMap>{OrientalMotorAz(), LeadshineRs(), AppliedMotion(),
                                Generic("generic", false), Generic("generic-low-word-first", true)};
  return *maps;
}

}  // namespace lightstage::sim
