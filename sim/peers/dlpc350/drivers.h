// The projector driver "sim-dlpc350": the simulated rig's projector, driven by the dlpc350 driver as a USB HID device that this process plugs in
// itself through the kernel's uhid, or has within itself. The rig's other devices may be any. Its table is that of driver "dlpc350" with mode
// "flash" and a `serial`; the flash holds the very patterns that the table says. [….peer]: sim/rig/wire.h, sim/rig/fault_plan.h.
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"

namespace lightstage::sim {

// `simulation` is what RegisterSimulatedDrivers() returned for this registry. Without hidapi the driver is known, but says so.
void RegisterDlpc350Peer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation);

}  // namespace lightstage::sim
