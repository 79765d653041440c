// The camera driver "sim-v4l2": the simulated rig's picture, taken by the v4l2 driver and the kernel's uvcvideo from a USB Video Class camera that
// this process plugs in itself, through the kernel's vhci-hcd. The rig's other devices may be any. Its table is that of driver
// "v4l2" with a `card`, which the camera gets for its name; frames_per_s, significant_bits and gain_db_per_step are those that it has. Further:
//
//   [….peer]               # also sim/rig/fault_plan.h
//   sensor_width = 640
//   sensor_height = 480
#pragma once

#include <memory>

#include "drivers/api/registry.h"
#include "sim/rig/drivers.h"

namespace lightstage::sim {

// `simulation` is what RegisterSimulatedDrivers() returned for this registry.
void RegisterUvcPeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation);

}  // namespace lightstage::sim
