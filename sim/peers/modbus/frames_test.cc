#include "sim/peers/modbus/frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lightstage::sim {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using Bytes = std::vector<uint8_t>;

// The request of an RTU frame with unit and CRC.
ModbusRequest Parse(const Bytes& frame) {
  EXPECT_EQ(RtuRequestLength(frame), frame.size());
  const std::span<const uint8_t> bytes(frame);
  EXPECT_EQ(ModbusCrc(bytes.first(frame.size() - 2)),
            frame[frame.size() - 2] | frame[frame.size() - 1] << 8);
  ParsedRequest parsed = ParseRequest(frame[0], bytes.subspan(1, frame.size() - 3));
  EXPECT_TRUE(parsed.request.has_value());
  return parsed.request.value_or(ModbusRequest{});
}

TEST(Frames, AreAsPublished) {
  // MOONS' M2 user manual, rev. 1.0, p. 155: the encoder position.
  const ModbusRequest read = Parse({0x01, 0x03, 0x00, 0x04, 0x00, 0x02, 0x85, 0xCA});
  EXPECT_EQ(read.function, 3);
  EXPECT_EQ(read.address, 4);
  EXPECT_EQ(read.count, 2);
  EXPECT_FALSE(read.writes());
  EXPECT_THAT(RtuFrame(1, ReplyPdu(read, {0, {0x0026, 0x25A0}})),
              ElementsAre(0x01, 0x03, 0x04, 0x00, 0x26, 0x25, 0xA0, 0x01, 0x10));
  // Leadshine CS2RS user manual, 4.2.6, example E.
  const ModbusRequest write = Parse({0x01, 0x10, 0x01, 0x46, 0x00, 0x04, 0x08, 0x00, 0x00, 0x00,
                                     0x28, 0x00, 0x00, 0x00, 0x29, 0x1C, 0x14});
  EXPECT_THAT(write.values, ElementsAre(0, 0x28, 0, 0x29));
  EXPECT_THAT(RtuFrame(1, ReplyPdu(write, {})),
              ElementsAre(0x01, 0x10, 0x01, 0x46, 0x00, 0x04, 0x21, 0xE3));
  // The same manual, 4.4.1: exception 1 to a function that it does not have.
  EXPECT_THAT(RtuFrame(1, ExceptionPdu(2, 1)), ElementsAre(0x01, 0x82, 0x01, 0x81, 0x60));
}

TEST(Frames, CoilsAreBitsLowFirst) {
  // MODBUS Application Protocol V1.1b3, 6.11: ten coils from 20.
  const Bytes pdu = {0x0F, 0x00, 0x13, 0x00, 0x0A, 0x02, 0xCD, 0x01};
  const ParsedRequest parsed = ParseRequest(1, pdu);
  ASSERT_TRUE(parsed.request.has_value());
  EXPECT_THAT(parsed.request->values, ElementsAre(1, 0, 1, 1, 0, 0, 1, 1, 1, 0));
  EXPECT_THAT(ReplyPdu(*parsed.request, {}), ElementsAre(0x0F, 0x00, 0x13, 0x00, 0x0A));
  // 6.1: nineteen of them, read.
  const ParsedRequest read = ParseRequest(1, Bytes{0x01, 0x00, 0x13, 0x00, 0x13});
  ASSERT_TRUE(read.request.has_value());
  EXPECT_THAT(
      ReplyPdu(*read.request, {0, {1, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 0, 1}}),
      ElementsAre(0x01, 0x03, 0xCD, 0x6B, 0x05));
  // 6.5: one of them.
  const Bytes one = {0x05, 0x00, 0xAC, 0xFF, 0x00};
  EXPECT_THAT(ReplyPdu(*ParseRequest(1, one).request, {}), ElementsAreArray(one));
}

TEST(Frames, OnTcp) {
  const Bytes pdu = {0x03, 0x00, 0x04, 0x00, 0x02};
  const Bytes frame = TcpFrame(0x1501, 0xFF, pdu);
  EXPECT_THAT(frame, ElementsAre(0x15, 0x01, 0, 0, 0, 6, 0xFF, 0x03, 0x00, 0x04, 0x00, 0x02));
  const std::optional<MbapHeader> header = ParseMbap(frame);
  ASSERT_TRUE(header.has_value());
  EXPECT_EQ(header->transaction, 0x1501);
  EXPECT_EQ(header->length, 6);
  EXPECT_EQ(header->unit, 0xFF);
  EXPECT_FALSE(ParseMbap(std::span(frame).first(6)).has_value());
}

TEST(Frames, NonsenseIsAnswered) {
  for (const Bytes& pdu :
       {Bytes{0x03, 0, 0, 0}, Bytes{0x03, 0, 0, 0, 0}, Bytes{0x03, 0, 0, 0, 126},
        Bytes{0x03, 0, 0, 0, 1, 0}, Bytes{0x01, 0, 0, 0x07, 0xD1}, Bytes{0x05, 0, 0, 1, 0},
        Bytes{0x10, 0, 0, 0, 1}, Bytes{0x10, 0, 0, 0, 1, 2}, Bytes{0x10, 0, 0, 0, 1, 3, 0, 0, 0},
        Bytes{0x10, 0, 0, 0, 0, 0}, Bytes{0x0F, 0, 0, 0, 9, 1, 0}}) {
    const ParsedRequest parsed = ParseRequest(1, pdu);
    EXPECT_FALSE(parsed.request.has_value());
    EXPECT_EQ(parsed.exception, 3);
  }
  EXPECT_EQ(ParseRequest(1, {}).exception, 1);
  EXPECT_EQ(ParseRequest(1, Bytes{0x2B, 0x0E, 1, 0}).exception, 1);
}

TEST(Frames, ARequestThatIsNotYetWhole) {
  EXPECT_EQ(RtuRequestLength(Bytes{1}), std::nullopt);
  EXPECT_EQ(RtuRequestLength(Bytes{1, 16, 0, 0, 0, 1}), std::nullopt);
  EXPECT_EQ(RtuRequestLength(Bytes{1, 16, 0, 0, 0, 1, 2}), size_t{11});
  EXPECT_EQ(RtuRequestLength(Bytes{1, 0x2B}), size_t{0});
}

}  // namespace
}  // namespace lightstage::sim
