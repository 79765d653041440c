#include "daemon/app/builtin_drivers.h"

#include "drivers/aravis/driver.h"
#include "sim/peers/gige/drivers.h"
#include "sim/rig/drivers.h"

namespace lightstage {

std::shared_ptr<sim::Simulation> RegisterBuiltinDrivers(DriverRegistry& registry) {
  std::shared_ptr<sim::Simulation> simulation = sim::RegisterSimulatedDrivers(registry);
  sim::RegisterGigePeer(registry, simulation);
  registry.cameras["aravis"] = AravisDriver();
  registry.discoveries["aravis"] = AravisDiscovery();
  return simulation;
}

}  // namespace lightstage
