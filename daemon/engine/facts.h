#pragma once

#include "daemon/capture/rig_facts.h"
#include "daemon/rig/rig.h"

namespace lightstage {

// What is constant about an opened rig. The rig outlives the facts.
RigFacts FactsOf(Rig& rig);

}  // namespace lightstage
