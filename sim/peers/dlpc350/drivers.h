// The projector driver "sim-dlpc350": the simulated rig's projector, driven by the dlpc350 driver as a USB HID device that this process plugs in
// itself through the kernel's uhid, or has within itself. The rig's other devices may be any. Its table is that of driver "dlpc350" with a
// `serial`; the flash holds the very patterns that the table says, and in mode "video" the input hangs on an output of its own,
// whose table is [….display]. [….peer]: sim/rig/wire.h, sim/rig/fault_plan.h.
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"
#include "sim/rig/video.h"

namespace lightstage::sim {

// `simulation` is what RegisterSimulatedDrivers() returned for this registry. Without hidapi the driver is known, but says so.
void RegisterDlpc350Peer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation,
                         const VideoOutputParser& output);

}  // namespace lightstage::sim
