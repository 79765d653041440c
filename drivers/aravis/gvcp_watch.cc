#include "drivers/aravis/gvcp_watch.h"

#include <sys/socket.h>

#include <cerrno>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

constexpr int kQuestions = 4;

}  // namespace

absl::StatusOr<std::unique_ptr<GvcpWatch>> GvcpWatch::Start(
    const sockaddr_in& camera, Duration patience,
    std::function<void(const std::string& why)> lost) {
  ASSIGN_OR_RETURN(GvcpSocket socket, GvcpSocket::Open(camera));
  return std::unique_ptr<GvcpWatch>(new GvcpWatch(std::move(socket), patience, std::move(lost)));
}

GvcpWatch::GvcpWatch(GvcpSocket socket, Duration patience,
                     std::function<void(const std::string&)> lost)
    : socket_(std::move(socket)),
      patience_(patience),
      lost_(std::move(lost)),
      thread_([this] { Watch(); }) {}

GvcpWatch::~GvcpWatch() {
  socket_.Stop();
  thread_.join();
}

// What counts are questions that were waited for: a busy computer does not make a camera seem lost.
void GvcpWatch::Watch() {
  int unanswered = 0;
  for (uint16_t id = 1;; id = static_cast<uint16_t>(id == 0xFFFF ? 1 : id + 1)) {
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
  const auto question = EncodeReadRegister(id, kGvcpControlPrivilege);
  // What the last question brought about (an ICMP message) fails this one: it was not answered either way.
  const bool sent = send(socket_.fd(), question.data(), question.size(), 0) >= 0;
  Heard heard = Heard::kNothing;
  // The whole time is waited also after the answer: the questions keep their distance.
  const auto end = std::chrono::steady_clock::now() + patience;
  while (true) {
    switch (socket_.Wait(end, /*listen=*/sent && heard == Heard::kNothing)) {
      case GvcpSocket::Ready::kStopped:
        return Heard::kEnd;
      case GvcpSocket::Ready::kTime:
        return heard;
      case GvcpSocket::Ready::kPacket:
        break;
    }
    std::array<std::byte, 576> packet;
    const ssize_t size = recv(socket_.fd(), packet.data(), packet.size(), 0);
    if (size < 0) continue;  // nobody listens there, says an ICMP message
    const auto answer = DecodeReadRegister({packet.data(), static_cast<size_t>(size)}, id);
    if (!answer.has_value()) continue;  // to an earlier question: too late
    heard = answer->refused || answer->value != 0 ? Heard::kControlled : Heard::kUncontrolled;
  }
}

}  // namespace lightstage
