// What a rig file's tables with driver = "modbus" say, as values.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/clock.h"
#include "base/toml.h"
#include "base/units.h"
#include "drivers/modbus/line.h"
#include "drivers/modbus/profile.h"

namespace lightstage {

struct ModbusAxisOptions {
  LineOptions line;
  int unit = 1;
  DriveProfile profile;
  // Rig angle = zero + position / steps_per_degree, the position counted backwards if `reverse`.
  double steps_per_degree = 0;
  bool reverse = false;
  Angle zero;
  double steps_per_rev = 0;  // of the motor; 0 if the profile does not need it
  Angle min, max;
  bool continuous = false;
  double max_velocity_dps = 0, max_acceleration_dps2 = 0;
  Duration settle{};
  Angle tolerance;
  Angle plausibility_move;  // at the end of homing; 0: none
  Duration poll{};
};

// Lamps of one unit: lamp i of these is at addresses[i].
struct LampBoard {
  int unit = 1;
  std::vector<int> addresses;
};

struct LampWatchdog {
  int address = 0;  // the register that takes the time, and starts it again whenever it is written
  Duration step{};  // of its value
  int max = 0;      // its highest value
};

struct ModbusLampsOptions {
  LineOptions line;
  std::vector<LampBoard> boards;  // their lamps one after the other
  bool registers = false;         // levels in holding registers; else coils
  int full = 1;                   // register value of full light
  bool inverted = false;          // a coil that is on makes its lamp dark
  bool single_writes = false;     // functions 5 and 6 only
  Duration settle{};
  Duration confirm{};  // so long after a write the board may still read back the old
  std::optional<LampWatchdog> watchdog;
  int lamps() const;
};

// They read the device's table strictly; errors go into the table.
ModbusAxisOptions ParseModbusAxisOptions(const TomlTable& table);
ModbusLampsOptions ParseModbusLampsOptions(const TomlTable& table);

}  // namespace lightstage
