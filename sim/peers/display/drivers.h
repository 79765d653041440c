// The projector driver "sim-display": the simulated rig's projector, driven by the display driver on an X server that this process starts.
// Its table is that of driver "display" with an `x_display` that no other server has. [….peer]: sim/rig/fault_plan.h.
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"
#include "sim/rig/video.h"

namespace lightstage::sim {

// The display driver on an output of its own, for whatever hangs on it. Its table is that of "sim-display".
VideoOutput ParseServedDisplay(const TomlTable& table);

// `simulation` is what RegisterSimulatedDrivers() returned for this registry.
void RegisterDisplayPeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation);

}  // namespace lightstage::sim
