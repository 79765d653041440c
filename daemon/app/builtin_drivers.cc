#include "daemon/app/builtin_drivers.h"

#include "drivers/aravis/driver.h"
#include "sim/peers/gige/drivers.h"
#include "sim/rig/drivers.h"

namespace lightstage {

void RegisterBuiltinDrivers(DriverRegistry& registry) {
  sim::RegisterGigePeer(registry, sim::RegisterSimulatedDrivers(registry));
  registry.cameras["aravis"] = AravisDriver();
}

}  // namespace lightstage
