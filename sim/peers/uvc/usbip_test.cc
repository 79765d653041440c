// The device's end of USB/IP, against what the kernel's document shows and against a host that is wrong; and the hub's ports.
#include "sim/peers/uvc/usbip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <thread>

#include "base/status.h"
#include "sim/peers/uvc/test_host.h"
#include "sim/peers/uvc/vhci.h"

namespace lightstage::sim {
namespace {

bool Never() { return false; }

UsbipHeader HeaderOf(const std::vector<uint32_t>& words) {
  UsbipHeader header = {};
  const Bytes bytes = TestHost::Header(words);
  std::copy(bytes.begin(), bytes.end(), header.begin());
  return header;
}

// Documentation/usb/usbip_protocol.rst, EXAMPLE.
TEST(Usbip, TheDocumentsExamples) {
  const auto in = ParseUsbipCommand(HeaderOf(
      {0x00000001, 0x00000d05, 0x0001000f, 1, 1, 0x00000200, 0x40, 0xffffffff, 0, 4, 0, 0}));
  ASSERT_TRUE(in.ok()) << in.status();
  EXPECT_EQ(*in, (UsbipCommand{.seqnum = 0xd05, .in = true, .endpoint = 1, .length = 0x40}));
  const auto out = ParseUsbipCommand(
      HeaderOf({0x00000001, 0x00000d06, 0x0001000f, 0, 1, 0, 0x40, 0xffffffff, 0, 4, 0, 0}));
  ASSERT_TRUE(out.ok()) << out.status();
  EXPECT_EQ(*out, (UsbipCommand{.seqnum = 0xd06, .endpoint = 1, .length = 0x40}));
  // The document's has −1 for start_frame, which it says shall be 0.
  EXPECT_EQ(UsbipSubmitAnswer(0xd05, 0, 0x40),
            HeaderOf({3, 0xd05, 0, 0, 0, 0, 0x40, 0, 0, 0, 0, 0}));
  EXPECT_EQ(UsbipUnlinkAnswer(0xd07, -104),
            HeaderOf({4, 0xd07, 0, 0, 0, 0xffffff98, 0, 0, 0, 0, 0, 0}));
  const auto unlink =
      ParseUsbipCommand(HeaderOf({2, 0xd07, 0x0001000f, 0, 0, 0xd05, 0, 0, 0, 0, 0, 0}));
  ASSERT_TRUE(unlink.ok()) << unlink.status();
  EXPECT_EQ(unlink->kind, UsbipCommand::Kind::kUnlink);
  EXPECT_EQ(unlink->unlinked, 0xd05u);
  // GET_DESCRIPTOR of the device, 64 bytes: the setup is as on the bus.
  const auto setup = ParseUsbipCommand(
      HeaderOf({1, 1, 0x00010000, 1, 0, 0x200, 64, 0, 0, 0, 0x80060001, 0x00004000}));
  ASSERT_TRUE(setup.ok()) << setup.status();
  EXPECT_EQ(setup->setup, (UsbSetup{0x80, 6, 0x0100, 0, 64}));
}

class Echo final : public UsbFunction {
 public:
  std::optional<Bytes> Control(const UsbSetup& setup, std::span<const uint8_t> data) override {
    if (setup.request == 0xff) return std::nullopt;
    last_.assign(data.begin(), data.end());
    return Bytes(10, setup.request);
  }
  Bytes last() const { return last_; }

 private:
  Bytes last_;
};

class UsbipTest : public testing::Test {
 protected:
  TestHost host_;
  Echo echo_;
  std::optional<UsbipConnection> connection_{std::in_place, host_.device_end(), echo_, 1};
};

TEST_F(UsbipTest, ControlTransfersAreAnsweredAndStall) {
  const auto in = host_.Control({0xa1, 7, 0, 0, 64});
  ASSERT_TRUE(in);
  EXPECT_EQ(in->status, 0);
  EXPECT_EQ(in->data, Bytes(10, 7));
  const auto brief = host_.Control({0xa1, 8, 0, 0, 4});
  ASSERT_TRUE(brief);
  EXPECT_EQ(brief->data, Bytes(4, 8));
  const auto out = host_.Control({0x21, 1, 0, 0, 3}, {1, 2, 3});
  ASSERT_TRUE(out);
  EXPECT_EQ(out->status, 0);
  EXPECT_EQ(echo_.last(), (Bytes{1, 2, 3}));
  const auto stalled = host_.Control({0xa1, 0xff, 0, 0, 64});
  ASSERT_TRUE(stalled);
  EXPECT_EQ(stalled->status, -EPIPE);
  EXPECT_TRUE(stalled->data.empty());
  host_.Submit(2, true, 512);  // there is no such endpoint
  const auto none = host_.Next();
  ASSERT_TRUE(none);
  EXPECT_EQ(none->status, -EPIPE);
}

// As a bus has it: a transfer ends with a packet that is not full, or where its receiver knows the end.
TEST_F(UsbipTest, BulkTransfersEndWithAShortPacket) {
  const auto lengths = [&](size_t bytes, size_t most, uint32_t request, int requests) {
    for (int i = 0; i < requests; ++i) host_.Submit(1, true, request);
    EXPECT_TRUE(connection_->Send(Bytes(bytes, 5), most, Never));
    std::vector<size_t> got;
    for (int i = 0; i < requests; ++i) {
      const auto answer = host_.Next();
      if (answer) got.push_back(answer->data.size());
    }
    return got;
  };
  EXPECT_EQ(lengths(700, 4096, 2048, 1), (std::vector<size_t>{700}));
  EXPECT_EQ(lengths(1500, 4096, 1024, 2), (std::vector<size_t>{1024, 476}));
  EXPECT_EQ(lengths(2048, 4096, 1024, 3), (std::vector<size_t>{1024, 1024, 0}));
  EXPECT_EQ(lengths(4096, 4096, 2048, 2), (std::vector<size_t>{2048, 2048}));
}

TEST_F(UsbipTest, AnUnlinkedRequestIsNeverAnswered) {
  const uint32_t first = host_.Submit(1, true, 512), second = host_.Submit(1, true, 512);
  ASSERT_TRUE(connection_->AwaitRequests(2, Never));
  const uint32_t unlinking = host_.Unlink(first);
  const auto unlinked = host_.Next();
  ASSERT_TRUE(unlinked);
  EXPECT_EQ(unlinked->command, 4u);
  EXPECT_EQ(unlinked->seqnum, unlinking);
  EXPECT_EQ(unlinked->status, -ECONNRESET);
  ASSERT_TRUE(connection_->Send(Bytes(3, 1), 512, Never));
  const auto answer = host_.Next();
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->seqnum, second);
  // Too late: it has been answered.
  host_.Unlink(second);
  const auto late = host_.Next();
  ASSERT_TRUE(late);
  EXPECT_EQ(late->command, 4u);
  EXPECT_EQ(late->status, 0);
}

// Senders and a host that asks and takes back at once: what was unlinked is not answered, everything else is, once.
TEST_F(UsbipTest, UnlinkingWhileBytesAreSent) {
  std::atomic<bool> over{false};
  std::thread sender([&] {
    while (connection_->Send(Bytes(100, 9), 4096, [&] { return over.load(); })) {
    }
  });
  for (int i = 0; i < 500; ++i) {
    const uint32_t request = host_.Submit(1, true, 512);
    host_.Unlink(request);
    int answers = 0;
    for (bool unlinked = false; !unlinked;) {
      const auto answer = host_.Next();
      ASSERT_TRUE(answer);
      if (answer->command == 3) {
        ++answers;
        EXPECT_EQ(answer->seqnum, request);
        continue;
      }
      unlinked = true;
      EXPECT_EQ(answer->status, answers == 0 ? -ECONNRESET : 0);
    }
  }
  over = true;
  connection_->Wake();
  sender.join();
}

TEST_F(UsbipTest, FailedRequestsCarryTheError) {
  host_.Submit(1, true, 512);
  host_.Submit(1, true, 512);
  ASSERT_TRUE(connection_->AwaitRequests(2, Never));
  connection_->FailRequests(EPROTO);
  for (int i = 0; i < 2; ++i) {
    const auto answer = host_.Next();
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, -EPROTO);
    EXPECT_TRUE(answer->data.empty());
  }
  EXPECT_EQ(connection_->requests(), 0u);
}

TEST(UsbipMalformed, EndsTheConnectionWithTheFieldsName) {
  const struct {
    std::vector<uint32_t> words;
    const char* field;
  } cases[] = {{{7, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "command is 7"},
               {{1, 1, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0}, "direction is 2"},
               {{1, 1, 0, 1, 16, 0, 0, 0, 0, 0, 0, 0}, "ep is 16"},
               {{1, 1, 0, 0, 0, 0, 0x7fffffff, 0, 0, 0, 0, 0}, "transfer_buffer_length"},
               {{1, 1, 0, 1, 1, 0, 512, 0, 8, 0, 0, 0}, "number_of_packets is 8"}};
  for (const auto& c : cases) {
    TestHost host;
    Echo echo;
    UsbipConnection connection(host.device_end(), echo, 1);
    host.Send(TestHost::Header(c.words));
    EXPECT_FALSE(host.Next()) << c.field;
    EXPECT_FALSE(connection.AwaitRequests(1, Never));
    EXPECT_EQ(ErrorReason(connection.status()), "USBIP_MALFORMED");
    EXPECT_NE(MessageOf(connection.status()).find(c.field), std::string::npos)
        << connection.status();
  }
}

TEST(UsbipMalformed, AHostThatHangsUpInTheMiddleEndsIt) {
  TestHost host;
  Echo echo;
  UsbipConnection connection(host.device_end(), echo, 1);
  host.Send(Bytes(20, 0));
  host.Hang();
  EXPECT_FALSE(connection.AwaitRequests(1, Never));
  EXPECT_EQ(ErrorReason(connection.status()), "USBIP_CLOSED");
}

TEST(Vhci, AFreePortOfHighSpeed) {
  const char* const kStatus =
      "hub port sta spd dev      sockfd local_busid\n"
      "hs  0000 006 003 00010000 000007 3-1\n"
      "hs  0001 005 000 00000000 000000 0-0\n"
      "hs  0002 004 000 00000000 000000 0-0\n"
      "hs  0003 004 000 00000000 000000 0-0\n"
      "ss  0015 004 000 00000000 000000 0-0\n";
  EXPECT_EQ(FreeVhciPort(kStatus), 2);
  EXPECT_EQ(FreeVhciPort(kStatus, 3), 3);
  EXPECT_EQ(FreeVhciPort(kStatus, 0), std::nullopt);
  EXPECT_EQ(FreeVhciPort(kStatus, 15), std::nullopt);
  EXPECT_EQ(FreeVhciPort(""), std::nullopt);
}

}  // namespace
}  // namespace lightstage::sim
