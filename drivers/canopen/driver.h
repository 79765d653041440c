// The driver "canopen": CiA 402 drives as axes and CiA 401 outputs as lamps, over the kernel's CAN interfaces. Options in README.md.
#pragma once

#include "drivers/api/registry.h"

namespace lightstage {

Driver<Axis> CanopenAxisDriver();
Driver<Lamps> CanopenLampsDriver();
Discovery CanopenDiscovery();

}  // namespace lightstage
