#include "drivers/aravis/gvcp_watch.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

constexpr int kQuestions = 4;
constexpr uint32_t kControlChannelPrivilege = 0x0A00;
constexpr uint16_t kReadRegister = 0x0080, kReadRegisterAck = 0x0081;
constexpr uint8_t kKey = 0x42, kAcknowledge = 0x01;

void Put16(std::byte* at, uint16_t value) {
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
  packet[1] = std::byte{kAcknowledge};
  Put16(&packet[2], kReadRegister);
  Put16(&packet[4], 4);  // bytes behind the header
  Put16(&packet[6], id);
  Put16(&packet[8], static_cast<uint16_t>(address >> 16));
  Put16(&packet[10], static_cast<uint16_t>(address));
  return packet;
}

std::optional<GvcpAnswer> DecodeReadRegister(std::span<const std::byte> packet, uint16_t id) {
  if (packet.size() < 8 || Get16(&packet[2]) != kReadRegisterAck || Get16(&packet[6]) != id) {
    return std::nullopt;
  }
  if (Get16(&packet[0]) != 0) return GvcpAnswer{.refused = true};
  if (packet.size() < 12 || Get16(&packet[4]) < 4) return std::nullopt;
  return GvcpAnswer{.value = static_cast<uint32_t>(Get16(&packet[8])) << 16 | Get16(&packet[10])};
}

absl::StatusOr<std::unique_ptr<GvcpWatch>> GvcpWatch::Start(
    const sockaddr_in& camera, Duration patience,
    std::function<void(const std::string& why)> lost) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket < 0) return ErrnoError(errno, "opening a socket for", "the camera");
  const int stop = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (stop < 0 || connect(socket, reinterpret_cast<const sockaddr*>(&camera), sizeof(camera)) < 0) {
    absl::Status error = ErrnoError(errno, "connecting a socket to", "the camera");
    close(socket);
    if (stop >= 0) close(stop);
    return error;
  }
  return std::unique_ptr<GvcpWatch>(new GvcpWatch(socket, stop, patience, std::move(lost)));
}

GvcpWatch::GvcpWatch(int socket, int stop, Duration patience,
                     std::function<void(const std::string&)> lost)
    : socket_(socket), stop_(stop), patience_(patience), lost_(std::move(lost)), thread_([this] {
        Watch();
      }) {}

GvcpWatch::~GvcpWatch() {
  eventfd_write(stop_, 1);
  thread_.join();
  close(socket_);
  close(stop_);
}

// What counts are questions that were waited for: a busy computer does not make a camera seem lost.
void GvcpWatch::Watch() {
  int unanswered = 0;
  for (uint16_t id = 1;; id = id == 0xFFFF ? 1 : id + 1) {
    switch (Ask(id, patience_ / kQuestions)) {
      case Heard::kEnd:
        return;
      case Heard::kControlled:
        unanswered = 0;
        break;
      case Heard::kUncontrolled:
        return lost_("nobody controls it any more: it was restarted, or let go");
      case Heard::kNothing:
        if (++unanswered < kQuestions) break;
        return lost_(
            absl::StrFormat("it has not answered for %g s: is it plugged in?", Seconds(patience_)));
    }
  }
}

GvcpWatch::Heard GvcpWatch::Ask(uint16_t id, Duration patience) const {
  using std::chrono::milliseconds;
  const auto question = EncodeReadRegister(id, kControlChannelPrivilege);
  // What the last question brought about (an ICMP message) fails this one: it was not answered either way.
  const bool sent = send(socket_, question.data(), question.size(), 0) >= 0;
  std::optional<Heard> heard;
  const auto end = std::chrono::steady_clock::now() + patience;
  // The whole time is waited also after the answer: the questions keep their distance.
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(end - std::chrono::steady_clock::now());
    pollfd fds[] = {{stop_, POLLIN, 0}, {socket_, POLLIN, 0}};
    const bool listen = sent && !heard.has_value();
    const int ready =
        poll(fds, listen ? 2 : 1, static_cast<int>(std::max<int64_t>(left.count(), 0)));
    if (fds[0].revents != 0) return Heard::kEnd;
    if (ready <= 0) return heard.value_or(Heard::kNothing);
    std::array<std::byte, 576> packet;
    const ssize_t size = recv(socket_, packet.data(), packet.size(), 0);
    if (size < 0) {
      if (errno == ECONNREFUSED) heard = Heard::kNothing;  // nobody listens there
      continue;
    }
    const auto answer = DecodeReadRegister({packet.data(), static_cast<size_t>(size)}, id);
    if (!answer.has_value()) continue;  // to an earlier question: too late
    heard = answer->refused || answer->value != 0 ? Heard::kControlled : Heard::kUncontrolled;
  }
}

}  // namespace lightstage
