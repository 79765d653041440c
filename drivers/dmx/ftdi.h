// The FTDI chip's vendor requests and the status it sends, as bytes. Pure functions.
//
// Sources: comments and constants of Linux' drivers/usb/serial/ftdi_sio.h (named at each), FT232R data sheet DS_FT232R 2.x §4.1 for the
// buffers, libftdi's test/baudrate.cpp for published divisors. README.md says what could not be checked.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drivers/dmx/usb_port.h"

namespace lightstage::dmx {

constexpr uint16_t kFtdiVendor = 0x0403, kFtdiProduct = 0x6001;
// Full-speed bulk packets. Each one from the chip begins with the two status bytes ("DATA FORMAT, IN Endpoint").
constexpr size_t kFtdiPacket = 64;
constexpr uint8_t kFtdiIn = 0x81, kFtdiOut = 0x02;  // endpoints of a chip with one port

// FTDI_SIO_RESET: everything, or one buffer. The names are ftdi_sio.h's; libftdi 1.5 found that they are seen from the chip, so that "RX" is what
// came from the host. Whoever wants clean buffers purges both.
enum class FtdiReset { kAll = 0, kPurgeRx = 1, kPurgeTx = 2 };
UsbRequest FtdiResetRequest(FtdiReset what);

// FTDI_SIO_MODEM_CTRL, one line at a time. `high` as in FTDI_SIO_SET_RTS_HIGH: the line is asserted.
UsbRequest FtdiDtrRequest(bool high);
UsbRequest FtdiRtsRequest(bool high);

// FTDI_SIO_SET_FLOW_CTRL with FTDI_SIO_DISABLE_FLOW_CTRL.
UsbRequest FtdiNoFlowControlRequest();

// FTDI_SIO_SET_BAUD_RATE of FT232BM and later with one port: base clock 48 MHz / 16 = 3 MHz, divisor in eighths, whose fraction is coded in bits
// 14 to 16 of value and index. `baud` from 183 to 3000000; nothing if no divisor comes within 3 %.
std::optional<UsbRequest> FtdiBaudRequest(int baud);

// FTDI_SIO_SET_DATA, eight data bits, no parity, two stop bits, which is what DMX512 wants (ANSI E1.11). `on_break`: bit 14, the line is
// held low.
UsbRequest FtdiDataRequest(bool on_break);

// FTDI_SIO_SET_LATENCY_TIMER: so many ms the chip waits before it sends a packet that is not full; 1 to 255.
UsbRequest FtdiLatencyRequest(uint8_t ms);

// FTDI_SIO_GET_MODEM_STATUS: the answer is the two status bytes as they are now.
UsbRequest FtdiStatusRequest();

struct FtdiStatus {
  uint8_t modem = 0, line = 0;
  // FTDI_RS_TEMT: nothing is left in the chip's buffer and in its shift register.
  bool transmitter_empty() const { return (line & 0x40) != 0; }
};
// Nothing if there are fewer than two bytes.
std::optional<FtdiStatus> DecodeFtdiStatus(std::span<const uint8_t> bytes);

// What the UART received, out of the packets of one bulk transfer: each packet without its status.
std::vector<uint8_t> FtdiPayload(std::span<const uint8_t> transfer);

}  // namespace lightstage::dmx
