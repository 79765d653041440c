#include "drivers/dmx/ftdi.h"

#include <algorithm>
#include <cmath>

namespace lightstage::dmx {
namespace {

constexpr uint8_t kOut = 0x40;  // vendor request to the device, without data
constexpr uint8_t kIn = 0xC0;

// Commands of ftdi_sio.h.
constexpr uint8_t kReset = 0, kModemCtrl = 1, kSetFlowCtrl = 2, kSetBaudRate = 3, kSetData = 4,
                  kGetModemStatus = 5, kSetLatencyTimer = 9;

}  // namespace

UsbRequest FtdiResetRequest(FtdiReset what) {
  return {kOut, kReset, static_cast<uint16_t>(what), 0};
}

UsbRequest FtdiDtrRequest(bool high) {
  return {kOut, kModemCtrl, static_cast<uint16_t>(0x0100 | (high ? 1 : 0)), 0};
}

UsbRequest FtdiRtsRequest(bool high) {
  return {kOut, kModemCtrl, static_cast<uint16_t>(0x0200 | (high ? 2 : 0)), 0};
}

UsbRequest FtdiNoFlowControlRequest() { return {kOut, kSetFlowCtrl, 0, 0}; }

std::optional<UsbRequest> FtdiBaudRequest(int baud) {
  if (baud < 183 || baud > 3000000) return std::nullopt;
  constexpr uint32_t kEighths = 24000000;  // of the 3 MHz clock
  const auto rate = static_cast<uint32_t>(baud);
  const uint32_t eighths = std::min<uint32_t>((kEighths + rate / 2) / rate, 0x1FFFF);
  if (eighths < 16 && eighths != 8 && eighths != 12) return std::nullopt;  // between 3, 2, 1.5 MHz
  const double missed = static_cast<double>(kEighths) / (static_cast<double>(eighths) * rate) - 1;
  if (std::abs(missed) > 0.03) return std::nullopt;
  // .000 .125 .250 .375 .500 .625 .750 .875
  constexpr uint32_t kFraction[8] = {0, 3, 2, 4, 1, 5, 6, 7};
  uint32_t divisor = (eighths >> 3) | kFraction[eighths & 7] << 14;
  if (divisor == 1) divisor = 0;       // 3 MHz
  if (divisor == 0x4001) divisor = 1;  // 2 MHz
  return UsbRequest{kOut, kSetBaudRate, static_cast<uint16_t>(divisor & 0xFFFF),
                    static_cast<uint16_t>(divisor >> 16)};
}

UsbRequest FtdiDataRequest(bool on_break) {
  constexpr uint16_t kTwoStopBits = 2 << 11, kBreak = 1 << 14;
  return {kOut, kSetData, static_cast<uint16_t>(8 | kTwoStopBits | (on_break ? kBreak : 0)), 0};
}

UsbRequest FtdiLatencyRequest(uint8_t ms) { return {kOut, kSetLatencyTimer, ms, 0}; }

UsbRequest FtdiStatusRequest() { return {kIn, kGetModemStatus, 0, 0}; }

std::optional<FtdiStatus> DecodeFtdiStatus(std::span<const uint8_t> bytes) {
  if (bytes.size() < 2) return std::nullopt;
  return FtdiStatus{bytes[0], bytes[1]};
}

std::vector<uint8_t> FtdiPayload(std::span<const uint8_t> transfer) {
  std::vector<uint8_t> payload;
  while (!transfer.empty()) {
    const std::span<const uint8_t> packet = transfer.first(std::min(kFtdiPacket, transfer.size()));
    if (packet.size() > 2) payload.insert(payload.end(), packet.begin() + 2, packet.end());
    transfer = transfer.subspan(packet.size());
  }
  return payload;
}

}  // namespace lightstage::dmx
