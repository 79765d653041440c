// The driver "dlpc350": TI's DLPC350 controller, as in the LightCrafter 4500, over USB. Options in README.md.
#pragma once

#include "drivers/api/projector.h"
#include "drivers/api/registry.h"

namespace lightstage {

// `screen` is the driver of the output that the projector's video input hangs on, for mode = "video"; its keys are in the sub-table
// "display". Without it that mode is refused at its key.
Driver<Projector> Dlpc350Driver(Driver<Projector> screen = {});

// The controllers on this machine's USB.
Discovery Dlpc350Discovery();

}  // namespace lightstage
