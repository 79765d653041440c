// The axis and lamps drivers "sim-canopen": the simulated rig's axes and lamps, driven by the canopen driver as nodes that this process serves
// itself, on an interface of the kernel (vcan, or a card's) or on one within the process. The rig's other devices may be any. Their tables
// are those of driver "canopen"; the node is what they say.
//
//   [….peer]                # and sim/rig/wire.h, sim/rig/fault_plan.h
//   interface = "can1"      # where the other end of the kernel's wire is another interface; default: that of the table
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"

namespace lightstage::sim {

// `simulation` is what RegisterSimulatedDrivers() returned for this registry.
void RegisterCanopenPeers(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation);

}  // namespace lightstage::sim
