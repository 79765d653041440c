#include "drivers/canopen/discovery.h"

#include <map>
#include <optional>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "drivers/canopen/cia402.h"
#include "drivers/canopen/identity.h"
#include "drivers/canopen/messages.h"

namespace lightstage::canopen {
namespace {

using Kind = SdoReply::Kind;

// For one answer of a node that has answered before.
constexpr Duration kAnswerTime = std::chrono::milliseconds(100);
constexpr size_t kLongestName = 64;

class Scan {
 public:
  Scan(CanPort& port, Clock& clock) : port_(port), clock_(clock) {}

  absl::Status Ask(int node, const SdoBytes& bytes) {
    return port_.Send(MakeFrame(static_cast<uint16_t>(kSdoClient + node), bytes));
  }

  // The next SDO answer of any node until `deadline`.
  absl::StatusOr<std::optional<std::pair<int, SdoReply>>> Answer(TimePoint deadline) {
    while (true) {
      const Duration left = deadline - clock_.Now();
      if (left <= Duration::zero()) return std::optional<std::pair<int, SdoReply>>();
      ASSIGN_OR_RETURN(const std::optional<CanEvent> event, port_.Receive(left));
      if (!event.has_value()) continue;
      if (event->kind == CanEvent::Kind::kError) {
        if (event->state == CanState::kBusOff) {
          return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                       "the controller is bus-off: is the bit rate right?");
        }
        continue;
      }
      if ((event->frame.id & kFunctionMask) != kSdoServer) continue;
      return std::optional(
          std::pair(event->frame.id & kNodeMask, DecodeSdoReply(event->frame.bytes())));
    }
  }

  // The node's answer to `bytes`, which asks for `object`; nothing if it has none.
  absl::StatusOr<std::optional<SdoReply>> Exchange(int node, const SdoBytes& bytes,
                                                   ObjectAddress object) {
    RETURN_IF_ERROR(Ask(node, bytes));
    const TimePoint deadline = clock_.Now() + kAnswerTime;
    while (true) {
      ASSIGN_OR_RETURN(const auto answer, Answer(deadline));
      if (!answer.has_value()) return std::optional<SdoReply>();
      const SdoReply& reply = answer->second;
      const bool segment = reply.kind == Kind::kUploadSegment;
      if (answer->first == node && (segment || reply.object == object)) {
        return std::optional(reply);
      }
    }
  }

  absl::StatusOr<uint32_t> Number(int node, ObjectAddress object) {
    ASSIGN_OR_RETURN(const auto reply, Exchange(node, EncodeUpload(object), object));
    if (!reply.has_value() || reply->kind != Kind::kUpload) return 0;
    return LittleEndian(reply->bytes());
  }

  absl::StatusOr<std::string> Name(int node) {
    constexpr ObjectAddress kName{0x1008, 0};
    ASSIGN_OR_RETURN(auto reply, Exchange(node, EncodeUpload(kName), kName));
    std::string name;
    auto append = [&](std::span<const uint8_t> bytes) {
      for (uint8_t c : bytes) {
        if (c >= 0x20 && c < 0x7F) name.push_back(static_cast<char>(c));
      }
    };
    if (!reply.has_value()) return name;
    if (reply->kind == Kind::kUpload) append(reply->bytes());
    if (reply->kind != Kind::kUploadBegin) return name;
    for (bool toggle = false, last = false; !last; toggle = !toggle) {
      ASSIGN_OR_RETURN(reply, Exchange(node, EncodeUploadSegment(toggle), kName));
      if (!reply.has_value() || reply->kind != Kind::kUploadSegment || reply->toggle != toggle ||
          name.size() > kLongestName) {
        // It is not to wait for us: the next client finds it ready.
        RETURN_IF_ERROR(Ask(node, EncodeAbort(kName, kAbortTimeout)));
        break;
      }
      append(reply->bytes());
      last = reply->last;
    }
    return name;
  }

 private:
  CanPort& port_;
  Clock& clock_;
};

}  // namespace

absl::StatusOr<std::vector<FoundNode>> ScanNodes(CanPort& port, Clock& clock, Duration patience) {
  constexpr ObjectAddress kDeviceType{0x1000, 0};
  Scan scan(port, clock);
  std::map<int, uint32_t> types;
  // Twice, for so many questions at once are more than some controllers hold.
  for (int round = 0; round < 2; ++round) {
    for (int node = 1; node <= kMaxNode; ++node) {
      if (types.count(node) == 0) RETURN_IF_ERROR(scan.Ask(node, EncodeUpload(kDeviceType)));
    }
    const TimePoint deadline = clock.Now() + patience / 2;
    while (true) {
      ASSIGN_OR_RETURN(const auto answer, scan.Answer(deadline));
      if (!answer.has_value()) break;
      const auto& [node, reply] = *answer;
      if (reply.kind != Kind::kUpload || reply.object != kDeviceType) continue;
      types[node] = LittleEndian(reply.bytes());
    }
  }
  std::vector<FoundNode> found;
  for (const auto& [node, type] : types) {
    FoundNode one{node, {}};
    one.identity.device_type = type;
    uint32_t* const parts[] = {&one.identity.vendor, &one.identity.product, &one.identity.revision,
                               &one.identity.serial};
    for (uint8_t sub = 1; sub <= 4; ++sub) {
      ASSIGN_OR_RETURN(*parts[sub - 1], scan.Number(node, {0x1018, sub}));
    }
    ASSIGN_OR_RETURN(one.identity.name, scan.Name(node));
    found.push_back(std::move(one));
  }
  return found;
}

Discovered DescribeNode(const std::string& interface, const FoundNode& found) {
  Discovered discovered;
  const NodeIdentity& is = found.identity;
  discovered.what = absl::StrCat("node ", found.node, " on ", interface, ": ", IdentityText(is));
  const std::string common = absl::StrFormat(
      "driver = \"canopen\"\ninterface = \"%s\"\nnode = %d\nvendor_id = 0x%08X\n"
      "product_code = 0x%08X\n%s",
      interface, found.node, is.vendor, is.product,
      is.serial == 0 ? "" : absl::StrFormat("serial_number = %d\n", is.serial));
  switch (is.device_type & 0xFFFF) {
    case kProfileDrive:
      discovered.toml = absl::StrCat(
          "[turntable]  # or [tilt]\n", common,
          "# continuous = true  # or min_deg and max_deg\n"
          "# units_per_turn =  # position units (6064h) of a turn of the axis\n"
          "# max_velocity_dps =\n# max_acceleration_dps2 =\n"
          "# homing_method =  # 6098h, see the drive's manual\n# homing_velocity_dps =\n");
      break;
    case kProfileIo:
      // The upper half says what it has: bit 17 digital, bit 19 analogue outputs (CiA 401).
      discovered.toml =
          absl::StrCat("[lamps]\n", common,
                       (is.device_type & 0x00020000) != 0 || (is.device_type & 0x00080000) == 0
                           ? "output = \"digital\"\n"
                           : "output = \"analogue\"\n");
      break;
    default:
      discovered.toml = "# no driver for this profile\n";
  }
  return discovered;
}

}  // namespace lightstage::canopen
