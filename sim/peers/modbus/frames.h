// Modbus requests and replies as bytes, from the server's side: MODBUS Application Protocol V1.1b3 (functions 1, 3, 4, 5, 6, 15, 16), MODBUS
// over Serial Line V1.02 (RTU), MODBUS Messaging on TCP/IP V1.0b. Pure functions; none reads beyond what it is given.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace lightstage::sim {

struct ModbusRequest {
  int unit = 1;
  int function = 3;
  int address = 0, count = 1;
  std::vector<uint16_t> values;  // to be written; a coil is 0 or 1

  bool writes() const { return !values.empty(); }
};

// What a device makes of a request: an exception's code, or what was read.
struct ModbusAnswer {
  int exception = 0;
  std::vector<uint16_t> values;
};

// `pdu`: function code and data. If there is no sense in it, the exception to answer with.
struct ParsedRequest {
  std::optional<ModbusRequest> request;
  int exception = 0;
};
ParsedRequest ParseRequest(int unit, std::span<const uint8_t> pdu);

// `answer` has as many values as were asked for.
std::vector<uint8_t> ReplyPdu(const ModbusRequest& request, const ModbusAnswer& answer);
std::vector<uint8_t> ExceptionPdu(int function, int exception);

uint16_t ModbusCrc(std::span<const uint8_t> bytes);

// The length, with CRC, of the RTU request that begins `bytes`: nothing if too little of it is there, 0 if its function is none of ours.
std::optional<size_t> RtuRequestLength(std::span<const uint8_t> bytes);
std::vector<uint8_t> RtuFrame(int unit, std::span<const uint8_t> pdu);

// What stands before a PDU on TCP.
struct MbapHeader {
  static constexpr size_t kSize = 7;
  uint16_t transaction = 0;
  uint16_t protocol = 0;
  uint16_t length = 0;  // of what follows the length, the unit included: 2 to 254
  uint8_t unit = 0;
};
// Nothing if too little of it is there.
std::optional<MbapHeader> ParseMbap(std::span<const uint8_t> bytes);
std::vector<uint8_t> TcpFrame(uint16_t transaction, int unit, std::span<const uint8_t> pdu);

}  // namespace lightstage::sim
