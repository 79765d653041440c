#include "drivers/aravis/gvcp.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/status.h"

namespace lightstage {
namespace {

// GigE Vision 2.0, clauses 15 to 18.
constexpr uint16_t kReadRegister = 0x0080, kReadRegisterAck = 0x0081, kPendingAck = 0x0089,
                   kEvent = 0x00C0, kEventAck = 0x00C1, kEventData = 0x00C2, kEventDataAck = 0x00C3;
constexpr int kKey = 0x42, kWantsAcknowledge = 0x01, kExtendedIds = 0x10;
constexpr size_t kHeader = 8, kShortEvent = 16, kLongEvent = 24;

void Put16(std::byte* at, int value) {
  at[0] = static_cast<std::byte>(value >> 8);
  at[1] = static_cast<std::byte>(value);
}
uint16_t Get16(const std::byte* at) {
  return static_cast<uint16_t>(std::to_integer<int>(at[0]) << 8 | std::to_integer<int>(at[1]));
}

}  // namespace

std::array<std::byte, 12> EncodeReadRegister(uint16_t id, uint32_t address) {
  std::array<std::byte, 12> packet{};
  packet[0] = std::byte{kKey};
  packet[1] = std::byte{kWantsAcknowledge};
  Put16(&packet[2], kReadRegister);
  Put16(&packet[4], 4);  // bytes behind the header
  Put16(&packet[6], id);
  Put16(&packet[8], static_cast<int>(address >> 16));
  Put16(&packet[10], static_cast<int>(address & 0xFFFF));
  return packet;
}

std::optional<GvcpAnswer> DecodeReadRegister(std::span<const std::byte> packet, uint16_t id) {
  if (packet.size() < kHeader || Get16(&packet[6]) != id) return std::nullopt;
  if (Get16(&packet[2]) == kPendingAck) return GvcpAnswer{.refused = true};
  if (Get16(&packet[2]) != kReadRegisterAck) return std::nullopt;
  if (Get16(&packet[0]) != 0) return GvcpAnswer{.refused = true};
  if (packet.size() < kHeader + 4 || Get16(&packet[4]) < 4) return std::nullopt;
  return GvcpAnswer{.value = static_cast<uint32_t>(Get16(&packet[8])) << 16 | Get16(&packet[10])};
}

std::optional<GvcpEvents> DecodeEvents(std::span<const std::byte> packet) {
  if (packet.size() < kHeader || packet[0] != std::byte{kKey}) return std::nullopt;
  const uint16_t command = Get16(&packet[2]);
  if (command != kEvent && command != kEventData) return std::nullopt;
  const int flags = std::to_integer<int>(packet[1]);
  const size_t size = (flags & kExtendedIds) != 0 ? kLongEvent : kShortEvent,
               length = Get16(&packet[4]);
  if (length < size || packet.size() < kHeader + length) return std::nullopt;
  GvcpEvents events;
  events.request = Get16(&packet[6]);
  events.with_data = command == kEventData;
  events.wants_acknowledge = (flags & kWantsAcknowledge) != 0;
  for (size_t at = 0; at + size <= length; at += size) {
    const std::byte* event = &packet[kHeader + at];
    uint64_t frame_id = Get16(event + 6);
    if (size == kLongEvent) {
      frame_id = 0;
      for (const std::byte* part = event + 8; part < event + 16; part += 2) {
        frame_id = frame_id << 16 | Get16(part);
      }
    }
    events.events.push_back({Get16(event + 2), frame_id});
    if (events.with_data) break;
  }
  return events;
}

std::array<std::byte, 8> EncodeEventAcknowledge(const GvcpEvents& events) {
  std::array<std::byte, 8> packet{};  // status 0, no bytes behind the header
  Put16(&packet[2], events.with_data ? kEventDataAck : kEventAck);
  Put16(&packet[6], events.request);
  return packet;
}

absl::StatusOr<GvcpSocket> GvcpSocket::Open(const sockaddr_in& peer) {
  GvcpSocket opened(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0),
                    eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (opened.socket_ < 0 || opened.stop_ < 0) {
    return ErrnoError(errno, "opening a socket for", "the camera");
  }
  sockaddr_in to = peer;
  if (to.sin_port == 0) to.sin_port = htons(kGvcpPort);
  const auto connect_to = [](int fd, const sockaddr_in& address) {
    return connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
  };
  if (connect_to(opened.socket_, to) < 0) return ErrnoError(errno, "reaching", "the camera");
  if (peer.sin_port != 0) return opened;
  // Connecting has chosen the interface: another socket listens there to any port of the camera's.
  sockaddr_in own = opened.address();
  own.sin_port = 0;
  close(opened.socket_);
  opened.socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (opened.socket_ < 0 ||
      bind(opened.socket_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)) < 0) {
    return ErrnoError(errno, "listening to", "the camera");
  }
  return opened;
}

GvcpSocket::GvcpSocket(GvcpSocket&& other) noexcept
    : socket_(std::exchange(other.socket_, -1)), stop_(std::exchange(other.stop_, -1)) {}

GvcpSocket::~GvcpSocket() {
  if (socket_ >= 0) close(socket_);
  if (stop_ >= 0) close(stop_);
}

sockaddr_in GvcpSocket::address() const {
  sockaddr_in own{};
  socklen_t size = sizeof(own);
  getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size);
  return own;
}

GvcpSocket::Ready GvcpSocket::Wait(std::chrono::steady_clock::time_point until, bool listen) const {
  using std::chrono::milliseconds;
  const auto left = std::chrono::ceil<milliseconds>(until - std::chrono::steady_clock::now());
  pollfd fds[] = {{stop_, POLLIN, 0}, {socket_, POLLIN, 0}};
  const int ready =
      poll(fds, listen ? 2 : 1, static_cast<int>(std::clamp<int64_t>(left.count(), 0, 1'000'000)));
  if (fds[0].revents != 0) return Ready::kStopped;
  return ready > 0 ? Ready::kPacket : Ready::kTime;
}

void GvcpSocket::Stop() const { eventfd_write(stop_, 1); }

}  // namespace lightstage
