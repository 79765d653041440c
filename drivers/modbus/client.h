// One unit on a line, as blocking calls. For one thread. Errors are Line::Do's.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/modbus/line.h"

namespace lightstage {

class ModbusClient {
 public:
  // `device`: its name in the rig file. The clock outlives the client.
  ModbusClient(LineOptions line, int unit, std::string device, Clock& clock);

  absl::Status Connect();

  // count ≤ 125.
  absl::StatusOr<std::vector<uint16_t>> ReadRegisters(int address, int count, bool input = false);
  absl::Status WriteRegister(int address, uint16_t value);                     // function 6
  absl::Status WriteRegisters(int address, std::span<const uint16_t> values);  // function 16; ≤ 123
  // count ≤ 2000.
  absl::StatusOr<std::vector<bool>> ReadCoils(int address, int count);
  absl::Status WriteCoil(int address, bool value);                        // function 5
  absl::Status WriteCoils(int address, const std::vector<bool>& values);  // function 15; ≤ 1968

  int unit() const { return unit_; }

 private:
  absl::Status Do(int function, int address, int count, absl::FunctionRef<int(modbus_t*)> call);

  const LineOptions options_;
  const int unit_;
  const std::string device_;
  Clock& clock_;
  std::shared_ptr<Line> line_;  // shared with the other devices on a serial line
  uint64_t session_ = 0;
};

}  // namespace lightstage
