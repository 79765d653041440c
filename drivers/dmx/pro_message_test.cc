#include "drivers/dmx/pro_message.h"

#include <gtest/gtest.h>

namespace lightstage::dmx {
namespace {

using Bytes = std::vector<uint8_t>;

Bytes Join(std::initializer_list<Bytes> parts) {
  Bytes all;
  for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// QLC+, plugins, EnttecDMXUSBPro::extractSerial: "7e 0a 00 00 e7", answered by "7E 0A 04 00 NN NN NN NN E7".
TEST(ProMessage, RequestsAreAsPublished) {
  EXPECT_EQ(EncodeProGetSerial(), (Bytes{0x7E, 0x0A, 0x00, 0x00, 0xE7}));
  EXPECT_EQ(EncodeProGetParameters(), (Bytes{0x7E, 0x03, 0x02, 0x00, 0x00, 0x00, 0xE7}));
}

// Enttec's forum, "DMX USB PRO COMMANDS": "7E + 6 + 1 + 2 + 0 + 512 bytes (values for ch's 1-512) + E7".
TEST(ProMessage, AWholeUniverseIsAsPublished) {
  Bytes slots(512, 0);
  slots[0] = 0x11;
  slots[511] = 0x22;
  const Bytes message = EncodeProOutput(slots);
  ASSERT_EQ(message.size(), 518u);
  EXPECT_EQ(Bytes(message.begin(), message.begin() + 6), (Bytes{0x7E, 6, 1, 2, 0, 0x11}));
  EXPECT_EQ(Bytes(message.end() - 2, message.end()), (Bytes{0x22, 0xE7}));
}

TEST(ProMessage, ComesOutOfAStreamInAnyPieces) {
  const Bytes stream = Join({{0x00, 0x7E, 0x01},                // noise that looks like a start
                             EncodePro(10, Bytes{1, 2, 3, 4}),  //
                             {0xE7, 0x55},                      //
                             EncodePro(3, Bytes{0x7E, 0xE7, 0, 0, 0x7E}),  // delimiters as data
                             EncodePro(5, {})});
  for (size_t piece = 1; piece <= stream.size(); ++piece) {
    ProDecoder decoder;
    std::vector<ProMessage> messages;
    for (size_t at = 0; at < stream.size(); at += piece) {
      decoder.Feed(std::span(stream).subspan(at, std::min(piece, stream.size() - at)));
      while (std::optional<ProMessage> message = decoder.Next()) messages.push_back(*message);
    }
    ASSERT_EQ(messages.size(), 3u) << "pieces of " << piece;
    EXPECT_EQ(messages[0].label, 10);
    EXPECT_EQ(messages[0].data, (Bytes{1, 2, 3, 4}));
    EXPECT_EQ(messages[1].label, 3);
    EXPECT_EQ(messages[1].data, (Bytes{0x7E, 0xE7, 0, 0, 0x7E}));
    EXPECT_EQ(messages[2].label, 5);
    EXPECT_TRUE(messages[2].data.empty());
  }
}

TEST(ProMessage, WhatIsNoMessageIsPassedOver) {
  const Bytes good = EncodePro(3, Bytes{1, 2, 3, 4, 5});
  for (const Bytes& bad : {Bytes{0x7E, 3, 0x59, 0x02},           // 601 bytes
                           Bytes{0x7E, 3, 0x01, 0x00, 9, 0xE6},  // no E7
                           Bytes{0x7E, 0x7E, 0x7E, 0x7E, 0x7E},  //
                           Bytes(5000, 0x7E), Bytes(5000, 0xE7)}) {
    ProDecoder decoder;
    decoder.Feed(bad);
    decoder.Feed(good);
    std::optional<ProMessage> message = decoder.Next();
    ASSERT_TRUE(message.has_value()) << bad.size();
    EXPECT_EQ(message->label, 3);
    EXPECT_EQ(message->data.size(), 5u);
    EXPECT_FALSE(decoder.Next().has_value());
  }
}

TEST(ProMessage, ParametersOfTheSpecification) {
  // Firmware 1.44, break 9 and mark 1 (96.03 and 10.67 µs, the smallest), 40 packets a second; user data are not ours.
  const std::optional<ProParameters> parameters =
      DecodeProParameters(Bytes{44, 1, 9, 1, 40, 0xAA, 0xBB});
  ASSERT_TRUE(parameters.has_value());
  EXPECT_EQ(parameters->firmware_major, 1);
  EXPECT_EQ(parameters->firmware_minor, 44);
  EXPECT_EQ(parameters->break_time, Duration(96030));
  EXPECT_EQ(parameters->mark_after_break, Duration(10670));
  EXPECT_EQ(parameters->packets_per_second, 40);
  EXPECT_FALSE(DecodeProParameters(Bytes{44, 1, 9, 1}).has_value());
  EXPECT_FALSE(DecodeProParameters({}).has_value());
}

TEST(ProMessage, SerialIsBcdLowFirst) {
  EXPECT_EQ(DecodeProSerial(Bytes{0x04, 0x68, 0x39, 0x00}), "00396804");
  EXPECT_EQ(DecodeProSerial(Bytes{0xFF, 0xFF, 0xFF, 0xFF}), "not programmed");
  EXPECT_FALSE(DecodeProSerial(Bytes{0x0A, 0, 0, 0}).has_value());
  EXPECT_FALSE(DecodeProSerial(Bytes{0xA0, 0, 0, 0}).has_value());
  EXPECT_FALSE(DecodeProSerial(Bytes{1, 2, 3}).has_value());
  EXPECT_FALSE(DecodeProSerial(Bytes{1, 2, 3, 4, 5}).has_value());
}

TEST(ProMessage, TimeToTheLineIsAPeriodAndAPacket) {
  ProParameters parameters{.break_time = Duration(100000), .mark_after_break = Duration(12000)};
  // 25 slots of 44 µs: 1.1 ms.
  const Duration packet = Duration(1212000);
  EXPECT_EQ(ProTimeToLine(parameters, 24), 2 * packet);
  parameters.packets_per_second = 10;
  EXPECT_EQ(ProTimeToLine(parameters, 24), std::chrono::milliseconds(100) + packet);
  // More than fit: the packet decides.
  parameters.packets_per_second = 40;
  EXPECT_EQ(ProTimeToLine(parameters, 24), std::chrono::milliseconds(25) + packet);
}

}  // namespace
}  // namespace lightstage::dmx
