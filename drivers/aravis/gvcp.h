// What of GigE Vision's control protocol (GVCP, GigE Vision 2.0) libaravis 0.8 does not do: the packets, and a socket to wait at.
#pragma once

#include <netinet/in.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "base/clock.h"

namespace lightstage {

// Where GigE Vision devices listen.
constexpr uint16_t kGvcpPort = 3956;

// Bootstrap registers, 32 bits each.
constexpr uint32_t kGvcpMessageChannels = 0x0900, kGvcpControlPrivilege = 0x0A00,
                   kGvcpMessagePort = 0x0B00, kGvcpMessageAddress = 0x0B10,
                   kGvcpMessageTimeoutMs = 0x0B14, kGvcpMessageRetries = 0x0B18;

// READREG_CMD for one register.
std::array<std::byte, 12> EncodeReadRegister(uint16_t id, uint32_t address);

// READREG_ACK to question `id`; nothing if it is anything else. A refusal, or the word that it takes a while (PENDING_ACK), is an answer without
// a value.
struct GvcpAnswer {
  bool refused = false;
  uint32_t value = 0;
};
std::optional<GvcpAnswer> DecodeReadRegister(std::span<const std::byte> packet, uint16_t id);

// EVENT_CMD or EVENTDATA_CMD, with 16 or 64 bits of block id; nothing if it is anything else, or cut off. Of EVENTDATA_CMD the data are skipped, and
// with them all events but the first.
struct GvcpEvent {
  uint16_t id = 0;
  uint64_t frame_id = 0;  // 0: of none
};
struct GvcpEvents {
  uint16_t request = 0;
  bool with_data = false;
  bool wants_acknowledge = false;
  std::vector<GvcpEvent> events;
};
std::optional<GvcpEvents> DecodeEvents(std::span<const std::byte> packet);
std::array<std::byte, 8> EncodeEventAcknowledge(const GvcpEvents& events);

// A UDP socket at which one thread waits and which another one stops.
class GvcpSocket {
 public:
  // Talks to `peer`; or, if its port is 0, hears whoever talks to it on the interface that leads to `peer`.
  static absl::StatusOr<GvcpSocket> Open(const sockaddr_in& peer);
  GvcpSocket(GvcpSocket&& other) noexcept;
  GvcpSocket& operator=(GvcpSocket&&) = delete;
  ~GvcpSocket();

  int fd() const { return socket_; }
  // Where it can be reached.
  sockaddr_in address() const;

  enum class Ready { kTime, kPacket, kStopped };
  // Waits until then for a packet, if it is to `listen`.
  Ready Wait(std::chrono::steady_clock::time_point until, bool listen) const;
  void Stop() const;

 private:
  GvcpSocket(int socket, int stop) : socket_(socket), stop_(stop) {}
  int socket_, stop_;
};

}  // namespace lightstage
