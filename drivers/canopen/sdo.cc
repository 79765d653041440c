#include "drivers/canopen/sdo.h"

#include <algorithm>

#include "absl/strings/str_format.h"

namespace lightstage::canopen {
namespace {

// Command specifiers, the top three bits of the first byte.
constexpr uint8_t kClientDownloadSegment = 0, kClientDownload = 1, kClientUpload = 2,
                  kClientUploadSegment = 3, kAbort = 4;
constexpr uint8_t kServerUploadSegment = 0, kServerDownloadSegment = 1, kServerUpload = 2,
                  kServerDownload = 3;
constexpr uint8_t kExpedited = 0x02, kSizeIndicated = 0x01, kToggle = 0x10, kLast = 0x01;

uint8_t Command(uint8_t specifier) { return static_cast<uint8_t>(specifier << 5); }

void PutObject(ObjectAddress object, SdoBytes* bytes) {
  (*bytes)[1] = static_cast<uint8_t>(object.index);
  (*bytes)[2] = static_cast<uint8_t>(object.index >> 8);
  (*bytes)[3] = object.sub;
}

void PutLong(uint32_t value, SdoBytes* bytes) {
  for (int i = 0; i < 4; ++i) (*bytes)[4 + i] = static_cast<uint8_t>(value >> (8 * i));
}

struct AbortName {
  uint32_t code;
  std::string_view name;
};

constexpr AbortName kAbortNames[] = {
    {0x05030000, "toggle bit not alternated"},
    {0x05040000, "SDO protocol timed out"},
    {0x05040001, "command specifier not valid or unknown"},
    {0x05040002, "invalid block size"},
    {0x05040003, "invalid sequence number"},
    {0x05040004, "CRC error"},
    {0x05040005, "out of memory"},
    {0x06010000, "unsupported access to an object"},
    {0x06010001, "attempt to read a write-only object"},
    {0x06010002, "attempt to write a read-only object"},
    {0x06020000, "object does not exist in the object dictionary"},
    {0x06040041, "object can not be mapped to the PDO"},
    {0x06040042, "number and length of the objects to be mapped would exceed the PDO's length"},
    {0x06040043, "general parameter incompatibility"},
    {0x06040047, "general internal incompatibility in the device"},
    {0x06060000, "access failed due to a hardware error"},
    {0x06070010, "data type does not match, length of service parameter does not match"},
    {0x06070012, "data type does not match, length of service parameter too high"},
    {0x06070013, "data type does not match, length of service parameter too low"},
    {0x06090011, "sub-index does not exist"},
    {0x06090030, "invalid value for parameter"},
    {0x06090031, "value of parameter written too high"},
    {0x06090032, "value of parameter written too low"},
    {0x06090036, "maximum value is less than minimum value"},
    {0x060A0023, "resource not available: SDO connection"},
    {0x08000000, "general error"},
    {0x08000020, "data can not be transferred or stored to the application"},
    {0x08000021, "data can not be transferred or stored because of local control"},
    {0x08000022, "data can not be transferred or stored because of the present device state"},
    {0x08000023, "no object dictionary is present, or it could not be generated"},
    {0x08000024, "no data available"},
};

}  // namespace

std::string ObjectText(ObjectAddress object) {
  return absl::StrFormat("%04Xh:%02X", object.index, object.sub);
}

SdoBytes EncodeUpload(ObjectAddress object) {
  SdoBytes bytes{Command(kClientUpload)};
  PutObject(object, &bytes);
  return bytes;
}

SdoBytes EncodeUploadSegment(bool toggle) {
  return {static_cast<uint8_t>(Command(kClientUploadSegment) | (toggle ? kToggle : 0))};
}

SdoBytes EncodeDownload(ObjectAddress object, std::span<const uint8_t> value) {
  SdoBytes bytes{static_cast<uint8_t>(Command(kClientDownload) | kSizeIndicated)};
  PutObject(object, &bytes);
  if (value.empty() || value.size() > 4) {
    PutLong(static_cast<uint32_t>(value.size()), &bytes);
    return bytes;
  }
  bytes[0] = static_cast<uint8_t>(bytes[0] | kExpedited | ((4 - value.size()) << 2));
  std::copy(value.begin(), value.end(), bytes.begin() + 4);
  return bytes;
}

SdoBytes EncodeDownloadSegment(bool toggle, std::span<const uint8_t> piece, bool last) {
  const size_t size = std::min<size_t>(piece.size(), 7);
  SdoBytes bytes{static_cast<uint8_t>(Command(kClientDownloadSegment) | (toggle ? kToggle : 0) |
                                      ((7 - size) << 1) | (last ? kLast : 0))};
  std::copy_n(piece.begin(), size, bytes.begin() + 1);
  return bytes;
}

SdoBytes EncodeAbort(ObjectAddress object, uint32_t code) {
  SdoBytes bytes{Command(kAbort)};
  PutObject(object, &bytes);
  PutLong(code, &bytes);
  return bytes;
}

SdoReply DecodeSdoReply(std::span<const uint8_t> frame) {
  SdoReply reply;
  // Some nodes leave out bytes that say nothing; what is looked at must be there.
  if (frame.size() < 4) return reply;
  const uint8_t command = frame[0];
  const ObjectAddress object{static_cast<uint16_t>(frame[1] | (frame[2] << 8)), frame[3]};
  auto take = [&](size_t from, size_t size) {
    if (frame.size() < from + size) return false;
    std::copy_n(frame.begin() + static_cast<std::ptrdiff_t>(from), size, reply.data.begin());
    reply.size = static_cast<uint8_t>(size);
    return true;
  };
  switch (command >> 5) {
    case kServerUpload: {
      const bool indicated = (command & kSizeIndicated) != 0;
      if ((command & kExpedited) != 0) {
        // Without a size all four bytes are given; the object's type says how many count.
        if (!take(4, indicated ? 4 - ((command >> 2) & 3) : 4)) return reply;
        reply.kind = SdoReply::Kind::kUpload;
      } else {
        if (indicated) {
          if (frame.size() < 8) return reply;
          reply.total = LittleEndian(frame.subspan(4, 4));
        }
        reply.kind = SdoReply::Kind::kUploadBegin;
      }
      reply.object = object;
      return reply;
    }
    case kServerUploadSegment:
      if (!take(1, 7 - ((command >> 1) & 7))) return reply;
      reply.kind = SdoReply::Kind::kUploadSegment;
      reply.toggle = (command & kToggle) != 0;
      reply.last = (command & kLast) != 0;
      return reply;
    case kServerDownload:
      reply.kind = SdoReply::Kind::kDownload;
      reply.object = object;
      return reply;
    case kServerDownloadSegment:
      reply.kind = SdoReply::Kind::kDownloadSegment;
      reply.toggle = (command & kToggle) != 0;
      return reply;
    case kAbort:
      if (frame.size() < 8) return reply;
      reply.kind = SdoReply::Kind::kAbort;
      reply.object = object;
      reply.abort = LittleEndian(frame.subspan(4, 4));
      return reply;
    default:
      return reply;
  }
}

std::string_view SdoAbortName(uint32_t code) {
  for (const AbortName& known : kAbortNames) {
    if (known.code == code) return known.name;
  }
  return "unknown abort code";
}

uint32_t LittleEndian(std::span<const uint8_t> bytes) {
  uint32_t value = 0;
  for (size_t i = 0; i < std::min<size_t>(bytes.size(), 4); ++i) {
    value |= static_cast<uint32_t>(bytes[i]) << (8 * i);
  }
  return value;
}

int32_t SignedLittleEndian(std::span<const uint8_t> bytes) {
  const size_t size = std::min<size_t>(bytes.size(), 4);
  const uint32_t value = LittleEndian(bytes);
  if (size == 0 || size == 4) return static_cast<int32_t>(value);
  const uint32_t sign = 1u << (8 * size - 1);
  return static_cast<int32_t>(value ^ sign) - static_cast<int32_t>(sign);
}

}  // namespace lightstage::canopen
