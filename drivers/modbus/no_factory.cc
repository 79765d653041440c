// In place of factory.cc where libmodbus was missing at build time.
#include "drivers/api/not_built.h"
#include "drivers/modbus/driver.h"

namespace lightstage {
namespace {

constexpr char kMissing[] =
    "this binary was built without libmodbus: install libmodbus-dev and build again";

}  // namespace

Driver<Axis> ModbusAxisDriver() { return NotBuiltDriver<Axis>(kMissing); }
Driver<Lamps> ModbusLampsDriver() { return NotBuiltDriver<Lamps>(kMissing); }
Discovery ModbusDiscovery() { return NotBuiltDiscovery(kMissing); }

}  // namespace lightstage
