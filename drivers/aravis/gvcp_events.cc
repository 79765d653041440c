#include "drivers/aravis/gvcp_events.h"

#include <sys/socket.h>

#include <optional>
#include <utility>

#include "base/status.h"

namespace lightstage {

absl::StatusOr<std::unique_ptr<GvcpEventChannel>> GvcpEventChannel::Open(
    const sockaddr_in& camera, Clock& clock,
    std::function<void(const GvcpEvent&, TimePoint)> event) {
  sockaddr_in any_port = camera;
  any_port.sin_port = 0;
  ASSIGN_OR_RETURN(GvcpSocket socket, GvcpSocket::Open(any_port));
  return std::unique_ptr<GvcpEventChannel>(
      new GvcpEventChannel(std::move(socket), camera, clock, std::move(event)));
}

GvcpEventChannel::GvcpEventChannel(GvcpSocket socket, const sockaddr_in& camera, Clock& clock,
                                   std::function<void(const GvcpEvent&, TimePoint)> event)
    : socket_(std::move(socket)),
      camera_(camera.sin_addr),
      clock_(clock),
      event_(std::move(event)),
      thread_([this] { Listen(); }) {}

GvcpEventChannel::~GvcpEventChannel() {
  socket_.Stop();
  thread_.join();
}

void GvcpEventChannel::Listen() {
  std::optional<uint16_t> last;
  while (true) {
    // A long time; nothing happens when it is over.
    const auto later = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    const GvcpSocket::Ready ready = socket_.Wait(later, /*listen=*/true);
    if (ready == GvcpSocket::Ready::kStopped) return;
    if (ready == GvcpSocket::Ready::kTime) continue;
    const TimePoint now = clock_.Now();
    std::array<std::byte, 576> packet;
    sockaddr_in from{};
    socklen_t from_size = sizeof(from);
    const ssize_t size = recvfrom(socket_.fd(), packet.data(), packet.size(), 0,
                                  reinterpret_cast<sockaddr*>(&from), &from_size);
    if (size < 0 || from.sin_addr.s_addr != camera_.s_addr) continue;
    const auto events = DecodeEvents({packet.data(), static_cast<size_t>(size)});
    if (!events.has_value()) continue;
    if (events->wants_acknowledge) {
      const auto answer = EncodeEventAcknowledge(*events);
      sendto(socket_.fd(), answer.data(), answer.size(), 0, reinterpret_cast<sockaddr*>(&from),
             from_size);
    }
    if (std::exchange(last, events->request) == events->request) continue;
    for (const GvcpEvent& event : events->events) event_(event, now);
  }
}

}  // namespace lightstage
