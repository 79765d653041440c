// The driver "modbus": drives as axes and relay or dimmer boards as lamps, through libmodbus, over TCP or a serial line (RTU). Options in
// README.md.
#pragma once

#include "drivers/api/registry.h"

namespace lightstage {

Driver<Axis> ModbusAxisDriver();
Driver<Lamps> ModbusLampsDriver();

// The serial ports that a bus may be on, without speaking to them. Devices on TCP can only be found by scanning the network, which it
// does not do.
Discovery ModbusDiscovery();

}  // namespace lightstage
