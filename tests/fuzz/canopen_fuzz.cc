// Frames of CANopen and of the kernel's CAN errors, data sheets, and the SDO server of the simulated nodes.
#include <algorithm>
#include <array>
#include <string>

#include "base/status.h"
#include "drivers/canopen/cia402.h"
#include "drivers/canopen/eds.h"
#include "drivers/canopen/messages.h"
#include "drivers/canopen/sdo.h"
#include "drivers/canopen/socket_can.h"
#include "sim/peers/canopen/object_dictionary.h"
#include "tests/fuzz/fuzz.h"

namespace lightstage::canopen {
namespace {

using fuzz::Input;
using Bytes = std::vector<uint8_t>;
using Kind = SdoReply::Kind;

void Sdo(std::span<const uint8_t> frame) {
  const SdoReply reply = DecodeSdoReply(frame);
  const bool has_data = reply.kind == Kind::kUpload || reply.kind == Kind::kUploadSegment;
  HOLDS(reply.size <= reply.data.size());
  HOLDS(has_data || reply.size == 0);
  const size_t head = reply.kind == Kind::kUpload ? 4 : 1;
  HOLDS(!has_data || head + reply.size <= frame.size());
  HOLDS(!has_data || std::ranges::equal(reply.bytes(), frame.subspan(head, reply.size)));
  HOLDS(frame.size() >= 4 || reply.kind == Kind::kUnknown);
  if (reply.kind == Kind::kAbort) {
    HOLDS(std::ranges::equal(EncodeAbort(reply.object, reply.abort), frame.first(8)) ||
          frame[0] != 0x80);
    HOLDS(!SdoAbortName(reply.abort).empty());
  }
  for (size_t size = 1; size <= std::min<size_t>(frame.size(), 4); ++size) {
    const int64_t value = SignedLittleEndian(frame.first(size));
    const int64_t modulus = int64_t{1} << 8 * size;
    HOLDS(value >= -modulus / 2 && value < modulus / 2);
    HOLDS((value - int64_t{LittleEndian(frame.first(size))}) % modulus == 0);
  }
}

void Messages(Input in) {
  const uint32_t error_id = in.Long();
  const CanError error = DecodeErrorFrame(error_id, in.rest());
  HOLDS(!error.text.empty());

  const std::optional<NmtState> state = DecodeHeartbeat(in.rest());
  HOLDS(!state || (!in.empty() && static_cast<uint8_t>(*state) == (in.rest()[0] & 0x7F)));
  HOLDS(!state || DecodeHeartbeat(EncodeHeartbeat(5, *state).bytes()) == state);

  const std::optional<Emergency> emergency = DecodeEmergency(in.rest());
  HOLDS(emergency.has_value() == (in.size() >= 8));
  if (emergency) {
    HOLDS(!EmergencyName(emergency->code).empty() && !EmergencyText(*emergency).empty());
    HOLDS(std::ranges::equal(emergency->vendor, in.rest().subspan(3, 5)));
  }

  const uint16_t status = in.Word();
  const std::optional<DriveState> drive = DecodeStatusword(status);
  // The eight states look at bits 0 to 3, 5 and 6.
  HOLDS(DecodeStatusword(status ^ 0xFF90) == drive);
  if (drive) HOLDS(!DriveStateName(*drive).empty());
  const HomingState homing = DecodeHoming(status);
  HOLDS(DecodeHoming(status ^ 0xCBFF) == homing);
  HOLDS((homing == HomingState::kReserved) == ((status & 0x3000) == 0x3000));
  HOLDS(!HomingStateName(homing).empty() && !ProfileText(error_id).empty());
}

void Pdos(Input in) {
  std::vector<MappedObject> mapping;
  const unsigned count = in.Choice(10);
  size_t bits = 0;
  for (unsigned i = 0; i < count; ++i) {
    const uint32_t entry = in.Choice(4) != 0 ? 0x60400000u + in.Byte() % 33 : in.Long();
    mapping.push_back(DecodeMapping(entry));
    HOLDS(EncodeMapping(mapping.back()) == entry);
    bits += mapping.back().bits;
  }
  const Bytes frame = in.Take(8);
  const auto values = UnpackPdo(frame, mapping);
  const bool possible = std::ranges::all_of(
      mapping, [](const MappedObject& mapped) { return mapped.bits > 0 && mapped.bits <= 32; });
  HOLDS(values.has_value() == (possible && bits <= 8 * frame.size()));
  if (!values) return;
  HOLDS(values->size() == mapping.size());
  const auto packed = PackPdo(*values, mapping);
  HOLDS(packed && packed->size() == (bits + 7) / 8);
  HOLDS(UnpackPdo(*packed, mapping) == values);
  HOLDS(std::equal(packed->begin(), packed->begin() + static_cast<ptrdiff_t>(bits / 8),
                   frame.begin()));
}

void DataSheet(Input in) {
  const int node = in.Byte() % kMaxNode + 1;
  const absl::StatusOr<Eds> eds = Eds::Parse(in.text(), "fuzz.eds", node);
  if (!eds.ok()) {
    HOLDS(ErrorReason(eds.status()) == "EDS_INVALID");
    HOLDS(MessageOf(eds.status()).starts_with("fuzz.eds:"));
    return;
  }
  HOLDS(eds->vendor() != 0u && eds->product() != 0u);
  for (uint16_t index : {0x1000, 0x1016, 0x1018, 0x1800, 0x6040, 0x607A, 0x6099}) {
    for (uint8_t sub = 0; sub < 4; ++sub) {
      const EdsObject* object = eds->Find({index, sub});
      for (int64_t value : {INT64_MIN, int64_t{0}, int64_t{UINT32_MAX}}) {
        const absl::Status allowed = eds->CheckWrite({index, sub}, value);
        HOLDS(!allowed.ok() || (object != nullptr && object->writable));
        HOLDS(object != nullptr || ErrorReason(allowed) == "OBJECT_MISSING");
      }
      if (object == nullptr || !object->writable) continue;
      if (object->low) {
        HOLDS(eds->CheckWrite({index, sub}, *object->low).ok());
        HOLDS(*object->low == INT64_MIN || !eds->CheckWrite({index, sub}, *object->low - 1).ok());
      }
      if (object->high) HOLDS(eds->CheckWrite({index, sub}, *object->high).ok());
    }
  }
}

// Any requests, and now and then a whole transfer by the driver's encoders, which must go through whatever was before it.
void Server(Input in) {
  sim::ObjectDictionary objects;
  objects.Constant(0x1000, 0, 4, 0x00020192);
  objects.Variable(0x6040, 0, 2, 0);
  objects.Text(0x1008, 0, "A name of more than seven bytes");
  objects.Text(0x2000, 1, "", true);
  sim::SdoServer server(objects);
  const ObjectAddress text{0x2000, 1};

  auto ask = [&](std::span<const uint8_t> request) {
    const std::optional<Bytes> answer = server.Handle(request);
    HOLDS(!answer || (answer->size() == 8 && request.size() == 8));
    const SdoReply reply = answer ? DecodeSdoReply(*answer) : SdoReply{};
    // What it says is known to the driver.
    HOLDS(!answer || reply.kind != Kind::kUnknown);
    // More than it has room for is refused.
    if (request.size() == 8 && (request[0] & 0xE3) == 0x21 &&
        LittleEndian(request.subspan(4)) > 1024) {
      HOLDS(reply.kind == Kind::kAbort);
    }
    return reply;
  };
  while (!in.empty()) {
    const unsigned choice = in.Choice(16);
    if (choice != 1) {
      ask(in.Take(choice == 0 ? 7 : 8));
      continue;
    }
    const Bytes sent = in.Take(5 + in.Byte() % 32);
    if (sent.size() < 5) break;
    HOLDS(ask(EncodeDownload(text, sent)).kind == Kind::kDownload);
    bool toggle = false;
    for (size_t at = 0; at < sent.size(); at += 7, toggle = !toggle) {
      const std::span<const uint8_t> piece =
          std::span(sent).subspan(at, std::min<size_t>(7, sent.size() - at));
      const SdoReply taken =
          ask(EncodeDownloadSegment(toggle, piece, at + piece.size() == sent.size()));
      HOLDS(taken.kind == Kind::kDownloadSegment && taken.toggle == toggle);
    }
    const SdoReply begin = ask(EncodeUpload(text));
    HOLDS(begin.kind == Kind::kUploadBegin && begin.total == sent.size() && begin.object == text);
    Bytes read;
    for (toggle = false;; toggle = !toggle) {
      const SdoReply piece = ask(EncodeUploadSegment(toggle));
      HOLDS(piece.kind == Kind::kUploadSegment && piece.toggle == toggle);
      read.insert(read.end(), piece.bytes().begin(), piece.bytes().end());
      if (piece.last) break;
      HOLDS(read.size() < sent.size());
    }
    HOLDS(read == sent);
  }
  HOLDS(objects.Value(0x1000, 0) == 0x00020192);
  HOLDS(objects.Value(0x6040, 0) <= 0xFFFF);
  HOLDS(objects.TextOf(0x2000, 1).size() <= 1024);
}

}  // namespace
}  // namespace lightstage::canopen

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lightstage::fuzz::Input in(data, size);
  switch (in.Choice(5)) {
    case 0:
      lightstage::canopen::Sdo(in.rest());
      break;
    case 1:
      lightstage::canopen::Messages(in);
      break;
    case 2:
      lightstage::canopen::Pdos(in);
      break;
    case 3:
      lightstage::canopen::DataSheet(in);
      break;
    default:
      lightstage::canopen::Server(in);
  }
  return 0;
}
