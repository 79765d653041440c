// The axis and lamps drivers "sim-modbus": the simulated rig's axes and lamps, driven by the modbus driver as drives and boards that this
// process serves itself. The rig's other devices may be any. Their tables are those of driver "modbus"; the drive or board is what they say,
// on 127.0.0.1 at `port`, or behind a pseudo-terminal whose name is made at `serial_port`. Every table has a line of its own.
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"

namespace lightstage::sim {

// `simulation` is what RegisterSimulatedDrivers() returned for this registry. Without libmodbus the driver is known, but says so.
void RegisterModbusPeers(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation);

}  // namespace lightstage::sim
