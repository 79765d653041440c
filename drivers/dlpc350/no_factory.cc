// In place of factory.cc where hidapi was missing at build time.
#include "drivers/api/not_built.h"
#include "drivers/dlpc350/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without hidapi: install libhidapi-dev and build again";

}  // namespace

Driver<Projector> Dlpc350Driver(Driver<Projector>) { return NotBuiltDriver<Projector>(kMissing); }
Discovery Dlpc350Discovery() { return NotBuiltDiscovery(kMissing); }

}  // namespace lightstage
