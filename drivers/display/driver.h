// The driver "display": a projector that is an output of this machine's graphics card. Options in README.md.
#pragma once

#include "drivers/api/projector.h"
#include "drivers/api/registry.h"

namespace lightstage {

Driver<Projector> DisplayDriver();

// The outputs of the X server that the environment's DISPLAY names.
Discovery DisplayDiscovery();

}  // namespace lightstage
