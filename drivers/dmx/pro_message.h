// The messages of an Enttec DMX USB Pro, as bytes: 7E, label, length (two bytes, low first), data, E7. Pure functions.
//
// Source: Enttec, "DMX USB Pro Widget API Specification 1.44", quoted below by section title.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/clock.h"

namespace lightstage::dmx {

constexpr uint8_t kProGetParameters = 3;  // request and reply
constexpr uint8_t kProOutput = 6;         // "Output Only Send DMX Packet Request"
constexpr uint8_t kProGetSerial =
    10;  // request and reply; ends the output, as all requests do but labels 3 and 6

constexpr size_t kProMaxData = 600;

struct ProMessage {
  uint8_t label = 0;
  std::vector<uint8_t> data;  // at most kProMaxData
};

std::vector<uint8_t> EncodePro(uint8_t label, std::span<const uint8_t> data);

// "Get Widget Parameters Request": no user configuration data wanted.
std::vector<uint8_t> EncodeProGetParameters();
std::vector<uint8_t> EncodeProGetSerial();
// "Output Only Send DMX Packet Request": start code 0 and 24 to 512 slots. The widget sends this packet again and again, until told otherwise.
std::vector<uint8_t> EncodeProOutput(std::span<const uint8_t> slots);

// Messages out of a stream of bytes that may begin anywhere and may hold anything. What is no message is passed over: after a wrong length or a
// missing E7 the search goes on behind that 7E.
class ProDecoder {
 public:
  void Feed(std::span<const uint8_t> bytes);
  // The next whole message; nothing if more bytes are needed.
  std::optional<ProMessage> Next();

 private:
  std::vector<uint8_t> pending_;
};

// "Get Widget Parameters Reply".
struct ProParameters {
  int firmware_major = 0, firmware_minor = 0;
  Duration break_time{}, mark_after_break{};  // in units of 10.67 µs
  int packets_per_second = 0;                 // 0: as many as possible
};
std::optional<ProParameters> DecodeProParameters(std::span<const uint8_t> data);

// "Get Widget Serial Number Reply": four BCD bytes, low first; as printed on the case. "not programmed" if it was never set (FFFFFFFF); nothing
// if it is no such reply.
std::optional<std::string> DecodeProSerial(std::span<const uint8_t> data);

// From the moment when the widget has new slots until a whole packet with them has been on the line, at most: the packet under way, the rest of its
// period, and the packet itself.
Duration ProTimeToLine(const ProParameters& parameters, size_t slots);

}  // namespace lightstage::dmx
