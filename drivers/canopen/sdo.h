// Service data objects: what a client says to read and write a node's object dictionary, and what the node's answers mean. CiA 301
// (4.2) 7.2.4, expedited and segmented transfers; block transfers are not used. Pure functions.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace lightstage::canopen {

struct ObjectAddress {
  uint16_t index = 0;
  uint8_t sub = 0;
  auto operator<=>(const ObjectAddress&) const = default;
};
std::string ObjectText(ObjectAddress object);  // "6041h:00"

using SdoBytes = std::array<uint8_t, 8>;  // an SDO frame is always eight bytes long

// ---- A client's requests

SdoBytes EncodeUpload(ObjectAddress object);
SdoBytes EncodeUploadSegment(bool toggle);
// 1 to 4 bytes go with the request itself; of more, only their number: segments follow.
SdoBytes EncodeDownload(ObjectAddress object, std::span<const uint8_t> value);
// `piece`: 1 to 7 bytes.
SdoBytes EncodeDownloadSegment(bool toggle, std::span<const uint8_t> piece, bool last);
SdoBytes EncodeAbort(ObjectAddress object, uint32_t code);

// ---- A server's answers

struct SdoReply {
  enum class Kind {
    kUnknown,          // none of what follows; too short counts too
    kUpload,           // the whole value, in `data`
    kUploadBegin,      // segments follow; `total` bytes if that is not 0
    kUploadSegment,    // `data`, `toggle`, `last`
    kDownload,         // taken, or ready for segments
    kDownloadSegment,  // taken, `toggle`
    kAbort,            // `abort`
  } kind = Kind::kUnknown;
  ObjectAddress object;  // not of segments
  std::array<uint8_t, 7> data{};
  uint8_t size = 0;  // of data
  uint32_t total = 0;
  bool toggle = false, last = false;
  uint32_t abort = 0;
  std::span<const uint8_t> bytes() const { return {data.data(), size}; }
};

SdoReply DecodeSdoReply(std::span<const uint8_t> frame);

// What CiA 301 table 22 calls an abort code; "unknown abort code" for others.
std::string_view SdoAbortName(uint32_t code);

constexpr uint32_t kAbortToggle = 0x05030000;
constexpr uint32_t kAbortTimeout = 0x05040000;
constexpr uint32_t kAbortMemory = 0x05040005;
constexpr uint32_t kAbortNoObject = 0x06020000;
constexpr uint32_t kAbortNoSubIndex = 0x06090011;

// Little-endian integers of 1 to 4 bytes, as objects hold them. Bytes beyond the fourth are not looked at.
uint32_t LittleEndian(std::span<const uint8_t> bytes);
int32_t SignedLittleEndian(std::span<const uint8_t> bytes);

}  // namespace lightstage::canopen
