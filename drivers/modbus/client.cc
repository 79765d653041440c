#include "drivers/modbus/client.h"

#include <modbus/modbus.h>

#include <utility>

#include "base/status.h"

namespace lightstage {

ModbusClient::ModbusClient(LineOptions line, int unit, std::string device, Clock& clock)
    : options_(std::move(line)), unit_(unit), device_(std::move(device)), clock_(clock) {}

absl::Status ModbusClient::Connect() {
  if (line_ == nullptr) {
    absl::StatusOr<std::shared_ptr<Line>> line = Line::Get(options_);
    if (!line.ok()) return Annotate(line.status(), device_);
    line_ = *std::move(line);
  }
  return line_->Open(device_, &session_);
}

absl::Status ModbusClient::Do(int function, int address, int count,
                              absl::FunctionRef<int(modbus_t*)> call) {
  if (line_ == nullptr) {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                 absl::StrCat(device_, ": ", options_.Name(), ": is not connected"),
                 {{"device", device_}, {"line", options_.Name()}});
  }
  return line_->Do(Request{device_, unit_, function, address, count}, session_, clock_, call);
}

absl::StatusOr<std::vector<uint16_t>> ModbusClient::ReadRegisters(int address, int count,
                                                                  bool input) {
  std::vector<uint16_t> values(count);
  RETURN_IF_ERROR(Do(input ? 4 : 3, address, count, [&](modbus_t* context) {
    return input ? modbus_read_input_registers(context, address, count, values.data())
                 : modbus_read_registers(context, address, count, values.data());
  }));
  return values;
}

absl::Status ModbusClient::WriteRegister(int address, uint16_t value) {
  return Do(6, address, 1,
            [&](modbus_t* context) { return modbus_write_register(context, address, value); });
}

absl::Status ModbusClient::WriteRegisters(int address, std::span<const uint16_t> values) {
  const int count = static_cast<int>(values.size());
  return Do(16, address, count, [&](modbus_t* context) {
    return modbus_write_registers(context, address, count, values.data());
  });
}

absl::StatusOr<std::vector<bool>> ModbusClient::ReadCoils(int address, int count) {
  std::vector<uint8_t> values(count);
  RETURN_IF_ERROR(Do(1, address, count, [&](modbus_t* context) {
    return modbus_read_bits(context, address, count, values.data());
  }));
  return std::vector<bool>(values.begin(), values.end());
}

absl::Status ModbusClient::WriteCoil(int address, bool value) {
  return Do(5, address, 1,
            [&](modbus_t* context) { return modbus_write_bit(context, address, value ? 1 : 0); });
}

absl::Status ModbusClient::WriteCoils(int address, const std::vector<bool>& values) {
  const int count = static_cast<int>(values.size());
  const std::vector<uint8_t> bytes(values.begin(), values.end());
  return Do(15, address, count, [&](modbus_t* context) {
    return modbus_write_bits(context, address, count, bytes.data());
  });
}

}  // namespace lightstage
