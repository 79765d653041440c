// The lamps driver "sim-dmx": the simulated rig's lamps, driven by the dmx driver through a widget: an Open DMX that this process plugs into the machine's
// own USB (ftdi_gadget.h), or that or a DMX USB Pro within itself. The rig's other devices may be any. Its table is that of driver "dmx" with a
// `serial`; the lamps hang on the very channels that the table says. [….peer]: sim/rig/wire.h, sim/rig/fault_plan.h.
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"

namespace lightstage::sim {

// `simulation` is what RegisterSimulatedDrivers() returned for this registry. Without libusb the driver is known, but says so.
void RegisterDmxPeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation);

}  // namespace lightstage::sim
