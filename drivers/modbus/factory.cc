#include "drivers/modbus/axis.h"
#include "drivers/modbus/discovery.h"
#include "drivers/modbus/driver.h"
#include "drivers/modbus/lamps.h"

namespace lightstage {

Driver<Axis> ModbusAxisDriver() {
  Driver<Axis> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Axis> {
    ModbusAxisOptions options = ParseModbusAxisOptions(table);
    return [options](const DeviceContext& context) { return OpenModbusAxis(options, context); };
  };
  return driver;
}

Driver<Lamps> ModbusLampsDriver() {
  Driver<Lamps> driver;
  driver.parse = [](const TomlTable& table) -> DeviceOpener<Lamps> {
    ModbusLampsOptions options = ParseModbusLampsOptions(table);
    return [options](const DeviceContext& context) { return OpenModbusLamps(options, context); };
  };
  return driver;
}

Discovery ModbusDiscovery() {
  return [] { return DiscoverModbus("/dev/serial/by-id"); };
}

}  // namespace lightstage
