#include "daemon/app/builtin_drivers.h"

#include "drivers/aravis/driver.h"
#include "drivers/display/driver.h"
#include "drivers/dlpc350/driver.h"
#include "drivers/dmx/driver.h"
#include "drivers/v4l2/driver.h"
#include "sim/peers/gige/drivers.h"
#include "sim/rig/drivers.h"

namespace lightstage {

std::shared_ptr<sim::Simulation> RegisterBuiltinDrivers(DriverRegistry& registry) {
  std::shared_ptr<sim::Simulation> simulation = sim::RegisterSimulatedDrivers(registry);
  sim::RegisterGigePeer(registry, simulation);
  registry.cameras["aravis"] = AravisDriver();
  registry.discoveries["aravis"] = AravisDiscovery();
  registry.cameras["v4l2"] = V4l2Driver();
  registry.discoveries["v4l2"] = V4l2Discovery();
  registry.lamps["dmx"] = DmxDriver();
  registry.discoveries["dmx"] = DmxDiscovery();
  registry.projectors["display"] = DisplayDriver();
  registry.discoveries["display"] = DisplayDiscovery();
  registry.projectors["dlpc350"] = Dlpc350Driver(DisplayDriver());
  registry.discoveries["dlpc350"] = Dlpc350Discovery();
  return simulation;
}

}  // namespace lightstage
