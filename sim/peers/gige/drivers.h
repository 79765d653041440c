// The camera driver "sim-gige": the simulated rig's picture, taken by the aravis driver from a GigE Vision camera that this process
// serves itself. The rig's other devices may be any; its table:
//
//   driver = "sim-gige"
//   address = "127.0.0.1"   # where the camera is served and looked for; all keys of the aravis driver may follow
//   [….peer]
//   sensor_width = 640      # even
//   sensor_height = 480
//   bits = 12               # of the 16-bit formats: 10, 12 or 16
//   packing = ""            # of the 16-bit formats but RGB: "p" or "Packed" as in Mono12p, Mono12Packed
//   chunk_data = false      # frames can say how they were exposed; the gain is in dB then
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"

namespace lightstage::sim {

// `simulation` is what RegisterSimulatedDrivers() returned for this registry. Without libaravis the driver is known, but says so.
void RegisterGigePeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation);

}  // namespace lightstage::sim
