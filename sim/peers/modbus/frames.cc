#include "sim/peers/modbus/frames.h"

namespace lightstage::sim {
namespace {

constexpr int kIllegalFunction = 1, kIllegalValue = 3;

int Word(std::span<const uint8_t> bytes, size_t at) { return bytes[at] << 8 | bytes[at + 1]; }

void AppendWord(std::vector<uint8_t>& bytes, int word) {
  bytes.push_back(static_cast<uint8_t>(word >> 8));
  bytes.push_back(static_cast<uint8_t>(word));
}

}  // namespace

ParsedRequest ParseRequest(int unit, std::span<const uint8_t> pdu) {
  if (pdu.empty()) return {std::nullopt, kIllegalFunction};
  ParsedRequest nonsense{std::nullopt, kIllegalValue};
  ModbusRequest request;
  request.unit = unit;
  request.function = pdu[0];
  switch (request.function) {
    case 1:
    case 3:
    case 4: {
      if (pdu.size() != 5) return nonsense;
      request.count = Word(pdu, 3);
      const int most = request.function == 1 ? 2000 : 125;
      if (request.count < 1 || request.count > most) return nonsense;
      break;
    }
    case 5:
    case 6: {
      if (pdu.size() != 5) return nonsense;
      int value = Word(pdu, 3);
      if (request.function == 5) {
        if (value != 0 && value != 0xFF00) return nonsense;
        value = value != 0 ? 1 : 0;
      }
      request.values.push_back(static_cast<uint16_t>(value));
      break;
    }
    case 15:
    case 16: {
      if (pdu.size() < 6) return nonsense;
      request.count = Word(pdu, 3);
      const bool coils = request.function == 15;
      if (request.count < 1 || request.count > (coils ? 1968 : 123)) return nonsense;
      const size_t bytes = coils ? (request.count + 7) / 8 : request.count * 2;
      if (pdu[5] != bytes || pdu.size() != 6 + bytes) return nonsense;
      for (int i = 0; i < request.count; ++i) {
        request.values.push_back(
            static_cast<uint16_t>(coils ? pdu[6 + i / 8] >> (i % 8) & 1 : Word(pdu, 6 + 2 * i)));
      }
      break;
    }
    default:
      return {std::nullopt, kIllegalFunction};
  }
  request.address = Word(pdu, 1);
  return {std::move(request), 0};
}

std::vector<uint8_t> ReplyPdu(const ModbusRequest& request, const ModbusAnswer& answer) {
  if (answer.exception != 0) return ExceptionPdu(request.function, answer.exception);
  std::vector<uint8_t> pdu = {static_cast<uint8_t>(request.function)};
  switch (request.function) {
    case 1: {
      std::vector<uint8_t> bytes((answer.values.size() + 7) / 8);
      for (size_t i = 0; i < answer.values.size(); ++i) {
        if (answer.values[i] != 0) bytes[i / 8] |= static_cast<uint8_t>(1 << i % 8);
      }
      pdu.push_back(static_cast<uint8_t>(bytes.size()));
      pdu.insert(pdu.end(), bytes.begin(), bytes.end());
      break;
    }
    case 3:
    case 4:
      pdu.push_back(static_cast<uint8_t>(2 * answer.values.size()));
      for (uint16_t value : answer.values) AppendWord(pdu, value);
      break;
    case 5:
      AppendWord(pdu, request.address);
      AppendWord(pdu, request.values[0] != 0 ? 0xFF00 : 0);
      break;
    case 6:
      AppendWord(pdu, request.address);
      AppendWord(pdu, request.values[0]);
      break;
    default:
      AppendWord(pdu, request.address);
      AppendWord(pdu, request.count);
  }
  return pdu;
}

std::vector<uint8_t> ExceptionPdu(int function, int exception) {
  return {static_cast<uint8_t>(function | 0x80), static_cast<uint8_t>(exception)};
}

uint16_t ModbusCrc(std::span<const uint8_t> bytes) {
  unsigned crc = 0xFFFF;
  for (uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0xA001 : crc >> 1;
  }
  return static_cast<uint16_t>(crc);
}

std::optional<size_t> RtuRequestLength(std::span<const uint8_t> bytes) {
  if (bytes.size() < 2) return std::nullopt;
  switch (bytes[1]) {
    case 1:
    case 3:
    case 4:
    case 5:
    case 6:
      return 8;
    case 15:
    case 16:
      if (bytes.size() < 7) return std::nullopt;
      return size_t{9} + bytes[6];
    default:
      return 0;
  }
}

std::vector<uint8_t> RtuFrame(int unit, std::span<const uint8_t> pdu) {
  std::vector<uint8_t> frame = {static_cast<uint8_t>(unit)};
  frame.insert(frame.end(), pdu.begin(), pdu.end());
  const uint16_t crc = ModbusCrc(frame);
  frame.push_back(static_cast<uint8_t>(crc));  // low byte first
  frame.push_back(static_cast<uint8_t>(crc >> 8));
  return frame;
}

std::optional<MbapHeader> ParseMbap(std::span<const uint8_t> bytes) {
  if (bytes.size() < MbapHeader::kSize) return std::nullopt;
  return MbapHeader{static_cast<uint16_t>(Word(bytes, 0)), static_cast<uint16_t>(Word(bytes, 2)),
                    static_cast<uint16_t>(Word(bytes, 4)), bytes[6]};
}

std::vector<uint8_t> TcpFrame(uint16_t transaction, int unit, std::span<const uint8_t> pdu) {
  std::vector<uint8_t> frame;
  AppendWord(frame, transaction);
  AppendWord(frame, 0);
  AppendWord(frame, static_cast<int>(pdu.size() + 1));
  frame.push_back(static_cast<uint8_t>(unit));
  frame.insert(frame.end(), pdu.begin(), pdu.end());
  return frame;
}

}  // namespace lightstage::sim
