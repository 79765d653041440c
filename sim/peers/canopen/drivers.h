// The axis and lamps drivers "sim-canopen": the simulated rig's axes and lamps, driven by the canopen driver as nodes that this process serves
// itself on an interface of the kernel (vcan, or a card's). The rig's other devices may be any. Their tables are those of driver
// "canopen"; the node is what they say. Where the other end of the wire is another interface:
//
//   [….peer]
//   interface = "can1"      # default: that of the table
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"

namespace lightstage::sim {

// `simulation` is what RegisterSimulatedDrivers() returned for this registry.
void RegisterCanopenPeers(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation);

}  // namespace lightstage::sim
