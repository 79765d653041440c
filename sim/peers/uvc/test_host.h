// The kernel's end of USB/IP in tests: asks as vhci-hcd does and checks that answers have the form that it insists on.
#pragma once

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "sim/peers/uvc/usbip.h"

namespace lightstage::sim {

using Bytes = std::vector<uint8_t>;

class TestHost {
 public:
  struct Answer {
    uint32_t command = 0, seqnum = 0;
    int status = 0;
    Bytes data;
  };

  TestHost() { EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM, 0, ends_), 0); }
  ~TestHost() { Hang(); }
  // For the device, which closes it.
  int device_end() const { return ends_[1]; }
  void Hang() {
    if (ends_[0] >= 0) close(std::exchange(ends_[0], -1));
  }

  void Send(std::span<const uint8_t> bytes) {
    ASSERT_EQ(write(ends_[0], bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  static Bytes Header(const std::vector<uint32_t>& words) {
    Bytes bytes;
    for (uint32_t word : words) {
      for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(word >> shift & 0xff);
    }
    return bytes;
  }

  // A request; its number.
  uint32_t Submit(uint32_t endpoint, bool in, uint32_t length, const UsbSetup& setup = {},
                  const Bytes& data = {}) {
    const uint32_t seqnum = ++seqnum_;
    Bytes bytes = Header({1, seqnum, 65536, in ? 1u : 0u, endpoint, 0, length, 0, 0, 0});
    for (int value : {setup.request_type, setup.request}) bytes.push_back(value & 0xff);
    for (int value : {setup.value, setup.index, setup.length}) {
      bytes.push_back(value & 0xff);
      bytes.push_back(value >> 8);
    }
    bytes.insert(bytes.end(), data.begin(), data.end());
    if (in) expected_[seqnum] = length;
    Send(bytes);
    return seqnum;
  }
  uint32_t Unlink(uint32_t seqnum) {
    Send(Header({2, ++seqnum_, 65536, 0, 0, seqnum, 0, 0, 0, 0, 0, 0}));
    return seqnum_;
  }

  // Nothing if the device has hung up, or none comes.
  std::optional<Answer> Next(int patience_ms = 20000) {
    pollfd ready = {ends_[0], POLLIN, 0};
    if (poll(&ready, 1, patience_ms) <= 0) return std::nullopt;
    Bytes header(kUsbipHeaderBytes);
    if (!Read(header)) return std::nullopt;
    const auto word = [&](size_t at) {
      return uint32_t{header[at]} << 24 | uint32_t{header[at + 1]} << 16 |
             uint32_t{header[at + 2]} << 8 | header[at + 3];
    };
    Answer answer{word(0), word(4), static_cast<int>(word(20)), {}};
    const auto asked = expected_.find(answer.seqnum);
    if (answer.command == 3 && asked != expected_.end()) {
      EXPECT_LE(word(24), asked->second) << "more than was asked for";
      answer.data.resize(word(24));
      EXPECT_TRUE(Read(answer.data));
      expected_.erase(asked);
    }
    return answer;
  }

  // A control transfer that is answered before anything else is.
  std::optional<Answer> Control(const UsbSetup& setup, const Bytes& data = {}) {
    const bool in = (setup.request_type & 0x80) != 0;
    const uint32_t seqnum = Submit(0, in, setup.length, setup, data);
    while (std::optional<Answer> answer = Next()) {
      if (answer->seqnum == seqnum) return answer;
      others_.push_back(*std::move(answer));
    }
    return std::nullopt;
  }
  // What came while a control transfer was waited for.
  std::vector<Answer> TakeOthers() { return std::exchange(others_, {}); }

 private:
  bool Read(std::span<uint8_t> bytes) {
    return bytes.empty() || recv(ends_[0], bytes.data(), bytes.size(), MSG_WAITALL) ==
                                static_cast<ssize_t>(bytes.size());
  }

  int ends_[2] = {-1, -1};
  uint32_t seqnum_ = 0;
  std::map<uint32_t, uint32_t> expected_;  // bytes, by seqnum
  std::vector<Answer> others_;
};

}  // namespace lightstage::sim
