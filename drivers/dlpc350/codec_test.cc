#include "drivers/dlpc350/codec.h"

#include <gtest/gtest.h>

#include "base/status.h"

namespace lightstage::dlpc350 {
namespace {

using Bytes = std::vector<uint8_t>;

Bytes Padded(Bytes bytes) {
  bytes.resize((bytes.size() + kReportSize - 1) / kReportSize * kReportSize, 0);
  return bytes;
}
Bytes Joined(const std::vector<Report>& reports) {
  Bytes bytes;
  for (const Report& report : reports) bytes.insert(bytes.end(), report.begin(), report.end());
  return bytes;
}

// TI, DLPC900 Programmer's Guide (DLPU018J), §1.2.2 and §1.2.3, tables 1-5 to 1-7: the framing that it has in common with the
// DLPC350; their examples read and write a curtain colour (command 0x1100).
constexpr Command kCurtain{0x11, 0x00, "curtain"};

TEST(Dlpc350Codec, ReadAsPublished) {
  const Report report = EncodeRead(kCurtain, 0x11);
  EXPECT_EQ(Bytes(report.begin(), report.end()), Padded({0xC0, 0x11, 0x02, 0x00, 0x00, 0x11}));
}

TEST(Dlpc350Codec, ReplyAsPublished) {
  const Bytes reply = Padded({0xC0, 0x11, 0x06, 0x00, 0xFF, 0x01, 0xFF, 0x01, 0xFF, 0x01});
  auto head = ParseReplyHead(reply);
  ASSERT_TRUE(head.ok());
  EXPECT_TRUE(head->read);
  EXPECT_FALSE(head->nack);
  EXPECT_EQ(head->sequence, 0x11);
  EXPECT_EQ(head->length, 6u);
  EXPECT_EQ(head->reports, 1u);
  EXPECT_EQ(*ParseReply(reply), Bytes({0xFF, 0x01, 0xFF, 0x01, 0xFF, 0x01}));
}

// Their example wants no acknowledgement (flags 0x00); ours always does (bit 6).
TEST(Dlpc350Codec, WriteAsPublished) {
  const Bytes color = {0xFF, 0x01, 0xFF, 0x01, 0xFF, 0x01};
  EXPECT_EQ(Joined(EncodeWrite(kCurtain, 0x12, color)),
            Padded({0x40, 0x12, 0x08, 0x00, 0x00, 0x11, 0xFF, 0x01, 0xFF, 0x01, 0xFF, 0x01}));
}

// DLPU018J §1.2, figure 1-5: a command of 76 bytes takes two transfers, and only the first has header and command.
TEST(Dlpc350Codec, LongMessagesGoOnInRawReports) {
  Bytes data(70);
  for (size_t i = 0; i < data.size(); ++i) data[i] = static_cast<uint8_t>(i + 1);
  const std::vector<Report> reports = EncodeWrite(kMailboxData, 5, data);
  ASSERT_EQ(reports.size(), 2u);
  EXPECT_EQ(Bytes(reports[0].begin(), reports[0].begin() + 7),
            Bytes({0x40, 5, 72, 0, 0x34, 0x1A, 1}));
  EXPECT_EQ(reports[0].back(), 58) << "58 bytes of data beside header and command";
  EXPECT_EQ(reports[1].front(), 59);
  EXPECT_EQ(reports[1][11], 70);
  EXPECT_EQ(reports[1][12], 0);
  // 58 bytes fill one report; a 59th needs the next.
  EXPECT_EQ(EncodeWrite(kMailboxData, 5, Bytes(58)).size(), 1u);
  EXPECT_EQ(EncodeWrite(kMailboxData, 5, Bytes(59)).size(), 2u);
  EXPECT_EQ(EncodeWrite(kMailboxData, 5, Bytes(384)).size(), 7u) << "128 entries of a LUT";
}

TEST(Dlpc350Codec, LongRepliesToo) {
  Bytes reply = {0xC0, 3, 100, 0};
  for (int i = 0; i < 100; ++i) reply.push_back(static_cast<uint8_t>(i));
  reply = Padded(reply);
  EXPECT_EQ(ParseReplyHead(std::span(reply).first(64))->reports, 2u);
  auto data = ParseReply(reply);
  ASSERT_TRUE(data.ok()) << data.status();
  ASSERT_EQ(data->size(), 100u);
  EXPECT_EQ(data->back(), 99);
  EXPECT_EQ(ErrorReason(ParseReply(std::span(reply).first(64)).status()), "REPLY_LENGTH");
}

TEST(Dlpc350Codec, ShortAndEndlessRepliesAreRefused) {
  const Bytes good = Padded({0xC0, 0, 1, 0, 7});
  for (size_t size = 0; size < good.size(); ++size) {
    EXPECT_EQ(ErrorReason(ParseReply(std::span(good).first(size)).status()), "REPORT_SHORT")
        << size;
  }
  EXPECT_EQ(ErrorReason(ParseReplyHead(Padded({0xC0, 0, 1, 2})).status()), "REPLY_LENGTH");
  EXPECT_EQ(ParseReplyHead(Padded({0xC0, 0, 0, 2}))->length, 512u);
  EXPECT_TRUE(ParseReplyHead(Padded({0xE0, 0, 0, 0}))->nack);
}

// As users of the LightCrafter 4500 posted them in TI's forum (e2e.ti.com, DLP products, threads 466576 and 400778): LUT entries
// "01 71 06" and "00 71 06 04 71 06"; exposure "10 27 00 00 10 27 00 00" for 10 ms.
TEST(Dlpc350Codec, LutEntriesAsPublished) {
  using Entry = std::array<uint8_t, 3>;
  const LutEntry first{
      .trigger = 1, .number = 0, .depth = 1, .leds = 7, .black = true, .swap = true};
  EXPECT_EQ(EncodeLutEntry(first), (Entry{0x01, 0x71, 0x06}));
  LutEntry second = first;
  second.trigger = 0;
  EXPECT_EQ(EncodeLutEntry(second), (Entry{0x00, 0x71, 0x06}));
  second.number = 1;
  EXPECT_EQ(EncodeLutEntry(second), (Entry{0x04, 0x71, 0x06}));
  EXPECT_EQ(EncodeExposure(10000, 10000),
            (std::array<uint8_t, 8>{0x10, 0x27, 0, 0, 0x10, 0x27, 0, 0}));
}

// DLPU010, table "Pattern Display LUT Access Control": the bits at both ends of each field.
TEST(Dlpc350Codec, LutEntriesComeBack) {
  for (int bits = 0; bits < 16; ++bits) {
    for (int number : {0, 1, 24, 63}) {
      for (int depth : {1, 8}) {
        const LutEntry entry{bits & 3,       number,         depth,          bits & 7,
                             (bits & 1) > 0, (bits & 2) > 0, (bits & 4) > 0, (bits & 8) > 0};
        EXPECT_EQ(DecodeLutEntry(EncodeLutEntry(entry)), entry);
      }
    }
  }
}

TEST(Dlpc350Codec, StatusesAreDescribed) {
  EXPECT_EQ(DescribeErrors({0x01, 0x01, 0x02}), "");
  EXPECT_EQ(DescribeErrors({0x00, 0x01, 0x02}), "its initialisation failed");
  EXPECT_EQ(DescribeErrors({0xC1, 0x01, 0x02}), "the sequencer aborted, sequencer error");
  EXPECT_EQ(DescribeErrors({0x01, 0x00, 0x02}), "its memory test failed");
  EXPECT_TRUE((StatusBits{1, 1, 1}).parked());
  EXPECT_FALSE((StatusBits{1, 1, 1}).running());
  EXPECT_TRUE((StatusBits{1, 1, 6}).running());
  EXPECT_TRUE((StatusBits{1, 1, 6}).frozen());
  EXPECT_EQ(DescribeValidation(0), "");
  for (int bit = 0; bit < 5; ++bit) EXPECT_NE(DescribeValidation(1 << bit), "") << bit;
}

TEST(Dlpc350Codec, Versions) {
  EXPECT_EQ(*ParseVersion(Bytes{5, 1, 2, 3, 9, 9}), "3.2.261");
  EXPECT_EQ(ErrorReason(ParseVersion(Bytes{5, 1, 2}).status()), "REPLY_LENGTH");
}

// dlpc350_api.cpp, DLPC350_SetTrigOutConfig: 0x00 = −20.05 µs, 0xBB = 0, 0xD4 = +2.68 µs, 0xD5 = +2.787 µs.
TEST(Dlpc350Codec, TriggerDelaysAsPublished) {
  EXPECT_EQ(EncodeTriggerOutDelay(-20.05), 0x00);
  EXPECT_EQ(EncodeTriggerOutDelay(-19.9428), 0x01);
  EXPECT_EQ(EncodeTriggerOutDelay(0), 0xBB);
  EXPECT_EQ(EncodeTriggerOutDelay(2.68), 0xD4);
  EXPECT_EQ(EncodeTriggerOutDelay(2.787), 0xD5);
  EXPECT_EQ(EncodeTriggerInDelay(0), (std::array<uint8_t, 4>{0, 0, 0, 0}));
  EXPECT_EQ(EncodeTriggerInDelay(0.1072 * 0x12345), (std::array<uint8_t, 4>{0x45, 0x23, 0x01, 0}));
}

}  // namespace
}  // namespace lightstage::dlpc350
