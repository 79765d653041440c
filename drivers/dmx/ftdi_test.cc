#include "drivers/dmx/ftdi.h"

#include <gtest/gtest.h>

#include <numeric>

namespace lightstage::dmx {
namespace {

void Expect(const UsbRequest& request, int type, int number, int value, int index) {
  EXPECT_EQ(request.type, type);
  EXPECT_EQ(request.request, number);
  EXPECT_EQ(request.value, value);
  EXPECT_EQ(request.index, index);
}

// Linux, drivers/usb/serial/ftdi_sio.h: the values of its macros, worked out.
TEST(Ftdi, RequestsAreTheKernels) {
  Expect(FtdiResetRequest(FtdiReset::kAll), 0x40, 0, 0, 0);      // FTDI_SIO_RESET_SIO
  Expect(FtdiResetRequest(FtdiReset::kPurgeRx), 0x40, 0, 1, 0);  // FTDI_SIO_RESET_PURGE_RX
  Expect(FtdiResetRequest(FtdiReset::kPurgeTx), 0x40, 0, 2, 0);  // FTDI_SIO_RESET_PURGE_TX
  Expect(FtdiDtrRequest(true), 0x40, 1, 0x0101, 0);              // FTDI_SIO_SET_DTR_HIGH
  Expect(FtdiDtrRequest(false), 0x40, 1, 0x0100, 0);             // FTDI_SIO_SET_DTR_LOW
  Expect(FtdiRtsRequest(true), 0x40, 1, 0x0202, 0);              // FTDI_SIO_SET_RTS_HIGH
  Expect(FtdiRtsRequest(false), 0x40, 1, 0x0200, 0);             // FTDI_SIO_SET_RTS_LOW
  Expect(FtdiNoFlowControlRequest(), 0x40, 2, 0, 0);             // FTDI_SIO_DISABLE_FLOW_CTRL
  // FTDI_SIO_SET_DATA_PARITY_NONE | FTDI_SIO_SET_DATA_STOP_BITS_2 | 8, and FTDI_SIO_SET_BREAK
  Expect(FtdiDataRequest(false), 0x40, 4, 0x1008, 0);
  Expect(FtdiDataRequest(true), 0x40, 4, 0x5008, 0);
  Expect(FtdiLatencyRequest(1), 0x40, 9, 1, 0);
  Expect(FtdiStatusRequest(), 0xC0, 5, 0, 0);  // FTDI_SIO_GET_MODEM_STATUS_REQUEST_TYPE
}

// DMX512: 250 kbaud is 3 MHz / 12, which needs no fraction.
TEST(Ftdi, DmxBaudIsTwelve) { Expect(FtdiBaudRequest(250000).value(), 0x40, 3, 12, 0); }

// libftdi, test/baudrate.cpp, TypeBMFixedBaudrates (which covers TYPE_R): baud, divisor, code of the fraction.
TEST(Ftdi, DivisorsAreLibftdis) {
  constexpr int kPublished[][3] = {
      {183, 16383, 7}, {184, 16304, 4}, {300, 10000, 0}, {600, 5000, 0},  {1200, 2500, 0},
      {2400, 1250, 0}, {4800, 625, 0},  {9600, 312, 1},  {19200, 156, 2}, {38400, 78, 3},
      {57600, 52, 3},  {115200, 26, 0}, {230400, 13, 0}, {460800, 6, 1},  {921600, 3, 2},
      {1000000, 3, 0}, {1050000, 2, 7}, {1400000, 2, 3}, {1500000, 2, 0}, {2000000, 1, 0},
      {3000000, 0, 0},
  };
  for (const auto& [baud, divisor, fraction] : kPublished) {
    const std::optional<UsbRequest> request = FtdiBaudRequest(baud);
    ASSERT_TRUE(request.has_value()) << baud;
    EXPECT_EQ(request->value & 0x3FFF, divisor) << baud;
    EXPECT_EQ((request->value >> 14) | (request->index & 1) << 2, fraction) << baud;
    EXPECT_EQ(request->index & ~1, 0) << baud;
  }
}

TEST(Ftdi, BaudRatesThatItCanNotMakeAreNone) {
  for (int baud : {-1, 0, 182, 3000001, 2500000}) {
    EXPECT_FALSE(FtdiBaudRequest(baud).has_value()) << baud;
  }
}

TEST(Ftdi, StatusTellsAnEmptyTransmitter) {
  EXPECT_FALSE(DecodeFtdiStatus({}).has_value());
  EXPECT_FALSE(DecodeFtdiStatus(std::vector<uint8_t>{0x01}).has_value());
  EXPECT_TRUE(DecodeFtdiStatus(std::vector<uint8_t>{0x01, 0x60})->transmitter_empty());
  EXPECT_FALSE(DecodeFtdiStatus(std::vector<uint8_t>{0x41, 0x20})->transmitter_empty());
}

// Every packet of a transfer begins with two bytes of status, not only the first.
TEST(Ftdi, PayloadIsWithoutStatus) {
  std::vector<uint8_t> transfer(2 * kFtdiPacket + 5);
  std::iota(transfer.begin(), transfer.end(), 0);
  std::vector<uint8_t> expected;
  for (int i = 0; i < 133; ++i) {
    if (i % 64 >= 2) expected.push_back(static_cast<uint8_t>(i));
  }
  EXPECT_EQ(FtdiPayload(transfer), expected);
  for (size_t length : {0, 1, 2}) {
    EXPECT_TRUE(FtdiPayload(std::span(transfer).first(length)).empty()) << length;
  }
  EXPECT_EQ(FtdiPayload(std::span(transfer).first(kFtdiPacket + 1)).size(), 62u);
}

}  // namespace
}  // namespace lightstage::dmx
