#include "daemon/app/builtin_drivers.h"

#include "drivers/aravis/driver.h"
#include "sim/rig/drivers.h"

namespace lightstage {

void RegisterBuiltinDrivers(DriverRegistry& registry) {
  sim::RegisterSimulatedDrivers(registry);
  registry.cameras["aravis"] = AravisDriver();
}

}  // namespace lightstage
