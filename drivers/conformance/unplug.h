// What every driver must do when its device is pulled off the bus: say so with a typed error within a second, hang nothing, keep no
// descriptor open, and find the device again.
#pragma once

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "base/clock.h"

namespace lightstage {

struct Unplugging {
  // Takes the device off its bus, as pulling its plug does, or puts it back, switched on.
  absl::FunctionRef<void(bool plugged)> plug;
  // An operation that needs the device, with a deadline far beyond a second.
  absl::FunctionRef<absl::Status()> use;
  // What `reset`, or the next run, does to bring it back.
  absl::FunctionRef<absl::Status()> recover;
};

// Three times: off, used, back, recovered, used. In at least one of them (the machine may be busy with other things) the second is kept, and in one
// it is recovered at the first try; prints the best time. To be called with the device open and good.
void CheckUnplugging(Clock& clock, const char* device, const Unplugging& unplugging);

}  // namespace lightstage
