// What a rig file's device table with driver = "canopen" says, as values.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/clock.h"
#include "base/toml.h"
#include "base/units.h"
#include "drivers/canopen/eds.h"

namespace lightstage::canopen {

// What every CANopen device has.
struct NodeOptions {
  std::string interface;  // of the kernel, e.g. "can0"
  int node = 0;           // 1 to 127
  // Expected of object 1018h; not given: any.
  std::optional<uint32_t> vendor, product, serial;
  Duration answer_time{};  // for each frame of an SDO answer
  Duration heartbeat{};    // without the node's heartbeat for so long, it is lost
  int heartbeat_id = 0;    // node id under which this computer says its own heartbeat for the node
  std::shared_ptr<const Eds> eds;  // shared: by options and nodes; may be none
};

struct AxisOptions {
  NodeOptions node;
  bool continuous = false;
  Angle min, max;  // unless continuous
  // Position units (6064h, 607Ah) of a turn of the axis, negative if it counts against the rig's sense; and the rig's angle at the
  // drive's 0.
  double units_per_turn = 0;
  Angle zero;
  // The drive's velocity units (6081h, 606Ch) of one turn per second, and acceleration units (6083h) of one turn/s²; > 0.
  double velocity_units = 0, acceleration_units = 0;
  double max_velocity_dps = 0, max_acceleration_dps2 = 0;
  Duration settle{};
  Angle tolerance;
  double standstill_dps = 0;  // slower counts as standing
  int homing_method = 0;      // 6098h
  double homing_velocity_dps = 0, homing_slow_velocity_dps = 0;
  bool stop_by_quick_stop = false;  // else by the halt bit, under power
  bool use_pdo = true;
  Duration
      poll{};  // how often the position is asked for while it moves; the TPDO's event timer too
  Duration enable_time{};    // for each step to operation enabled
  Duration setpoint_time{};  // for the acknowledge of a set-point
};

enum class LampOutput { kDigital, kAnalogue };

struct LampsOptions {
  NodeOptions node;
  LampOutput output = LampOutput::kDigital;
  int first_output = 0;  // of the module, that lamp 0 hangs on; counted from 0
  int full_scale = 0;    // analogue: what is written for level 1, 1 to 32767
  Duration settle{};
};

// Read the device's table strictly; errors go into the table. An EDS is read here.
AxisOptions ParseAxisOptions(const TomlTable& table);
LampsOptions ParseLampsOptions(const TomlTable& table);

}  // namespace lightstage::canopen
