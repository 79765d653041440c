// In place of drivers.cc where libaravis was missing at build time.
#include "drivers/aravis/driver.h"
#include "sim/peers/gige/drivers.h"

namespace lightstage::sim {

void RegisterGigePeer(DriverRegistry& registry, const std::shared_ptr<Simulation>&) {
  registry.cameras["sim-gige"] = AravisDriver();  // says what is missing
}

}  // namespace lightstage::sim
