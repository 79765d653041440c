// Faults on a rig's wires, at random moments: each shot is retaken, or the run pauses dark with a reason that names the device that had the fault;
// what is stored in the end is what an undisturbed capture stores.
#pragma once

#include <string>
#include <vector>

#include "tests/harness/daemon.h"

namespace lightstage {

// Captures the plan with `faulty_rig` again and again until there were so many faults and a run was disturbed by one, and compares each time
// with what `direct_rig` stored; `exposure_s` is the bracket's longest. With 50 faults or more every kind must have come.
void Campaign(const std::string& direct_rig, const std::string& faulty_rig,
              const std::vector<std::string>& plan, size_t faults, double exposure_s = 0.016);

}  // namespace lightstage
