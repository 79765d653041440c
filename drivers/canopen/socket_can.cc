#include "drivers/canopen/socket_can.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>

#include "base/status.h"

namespace lightstage::canopen {
namespace {

// ARPHRD_CAN of linux/if_arp.h, as /sys/class/net/*/type has it.
constexpr int kCanType = 280;
// How long a full transmit queue is waited for: at 10 kbit/s ten frames take 130 ms.
constexpr Duration kQueueTime = std::chrono::milliseconds(200);
// Receive times of the kernel that lie further back are not believed: its wall clock was set.
constexpr Duration kOldest = std::chrono::seconds(2);

absl::Status Lost(const std::string& interface, const std::string& what) {
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", absl::StrCat(interface, " ", what),
               {{"interface", interface}});
}

absl::Status LostBy(const std::string& interface, int error) {
  switch (error) {
    case ENETDOWN:
      return Lost(interface, "is down: ip link set " + interface + " up");
    case ENODEV:
    case ENXIO:
      return Lost(interface, "is gone: was its adapter unplugged?");
    default:
      return Lost(interface, std::string("failed: ") + std::generic_category().message(error));
  }
}

class SocketCanPort final : public CanPort {
 public:
  SocketCanPort(std::string interface, int socket, CanState state, Clock& clock)
      : interface_(std::move(interface)), socket_(socket), state_(state), clock_(clock) {}
  ~SocketCanPort() override { close(socket_); }

  absl::Status Send(const CanFrame& frame) override {
    can_frame raw{};
    raw.can_id = frame.id & CAN_SFF_MASK;
    raw.can_dlc = std::min<uint8_t>(frame.size, CAN_MAX_DLEN);
    std::copy_n(frame.data.begin(), raw.can_dlc, raw.data);
    const TimePoint deadline = clock_.Now() + kQueueTime;
    while (true) {
      const ssize_t sent = send(socket_, &raw, sizeof raw, MSG_DONTWAIT | MSG_NOSIGNAL);
      if (sent == sizeof raw) return absl::OkStatus();
      const int error = sent < 0 ? errno : EIO;
      if (error == EINTR) continue;
      // A full queue of the interface is ENOBUFS, which poll() does not wait for.
      if (error != ENOBUFS && error != EAGAIN) return LostBy(interface_, error);
      if (clock_.Now() > deadline) {
        return Lost(interface_,
                    "takes no more frames: nobody acknowledges them, is the bus connected and its "
                    "bit rate right?");
      }
      SleepFor(clock_, std::chrono::milliseconds(1));
    }
  }

  absl::StatusOr<std::optional<CanEvent>> Receive(Duration timeout) override {
    const TimePoint deadline = clock_.Now() + timeout;
    while (true) {
      const Duration left = std::max<Duration>(deadline - clock_.Now(), Duration::zero());
      const timespec wait{static_cast<time_t>(left / std::chrono::seconds(1)),
                          static_cast<long>((left % std::chrono::seconds(1)).count())};
      pollfd ready{socket_, POLLIN, 0};
      const int polled = ppoll(&ready, 1, &wait, nullptr);
      if (polled < 0 && errno != EINTR) return LostBy(interface_, errno);
      if (polled > 0) {
        ASSIGN_OR_RETURN(std::optional<CanEvent> event, ReceiveNow());
        if (event.has_value()) return event;
      }
      if (clock_.Now() >= deadline) return std::optional<CanEvent>();
    }
  }

  CanState state() const override { return state_; }

 private:
  // Nothing: there was none, or one that CANopen does not have.
  absl::StatusOr<std::optional<CanEvent>> ReceiveNow() {
    can_frame raw{};
    iovec part{&raw, sizeof raw};
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof(timespec))];
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof control;
    const ssize_t got = recvmsg(socket_, &message, MSG_DONTWAIT);
    if (got < 0) {
      if (errno == EAGAIN || errno == EINTR) return std::optional<CanEvent>();
      return LostBy(interface_, errno);
    }
    if (got != sizeof raw) return std::optional<CanEvent>();
    CanEvent event;
    event.time = TimeOf(message);
    const std::span<const uint8_t> data(raw.data, std::min<size_t>(raw.can_dlc, CAN_MAX_DLEN));
    if ((raw.can_id & CAN_ERR_FLAG) != 0) {
      CanError error = DecodeErrorFrame(raw.can_id, data);
      event.kind = CanEvent::Kind::kError;
      event.state = error.state;
      event.error = std::move(error.text);
      return std::optional(std::move(event));
    }
    if ((raw.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG)) != 0) return std::optional<CanEvent>();
    event.frame = MakeFrame(static_cast<uint16_t>(raw.can_id & CAN_SFF_MASK), data);
    return std::optional(std::move(event));
  }

  TimePoint TimeOf(msghdr& message) const {
    const TimePoint now = clock_.Now();
    for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
      if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS) continue;
      timespec stamp{}, wall{};
      std::memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
      clock_gettime(CLOCK_REALTIME, &wall);
      const Duration age =
          std::chrono::seconds(wall.tv_sec - stamp.tv_sec) + Duration(wall.tv_nsec - stamp.tv_nsec);
      if (age >= Duration::zero() && age <= kOldest) return now - age;
    }
    return now;
  }

  const std::string interface_;
  const int socket_;
  const CanState state_;
  Clock& clock_;
};

}  // namespace

CanError DecodeErrorFrame(uint32_t id, std::span<const uint8_t> data) {
  CanError error;
  auto at = [&](size_t i) { return i < data.size() ? data[i] : uint8_t{0}; };
  auto add = [&](const char* what) {
    if (!error.text.empty()) error.text += ", ";
    error.text += what;
  };
  // From the mildest to the worst: the last one said holds.
  if ((id & CAN_ERR_TX_TIMEOUT) != 0) add("transmit timeout");
  if ((id & CAN_ERR_LOSTARB) != 0) add("lost arbitration");
  if ((id & CAN_ERR_PROT) != 0) add("protocol violation");
  if ((id & CAN_ERR_TRX) != 0) add("transceiver error");
  if ((id & CAN_ERR_ACK) != 0) add("no acknowledge on transmission");
  if ((id & CAN_ERR_BUSERROR) != 0) add("bus error");
  if ((id & CAN_ERR_RESTARTED) != 0) {
    add("controller restarted");
    error.state = CanState::kActive;
  }
  if ((id & CAN_ERR_CRTL) != 0) {
    const uint8_t controller = at(1);
    if ((controller & (CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW)) != 0) {
      add("buffer overflow: frames were lost");
    }
    if ((controller & CAN_ERR_CRTL_ACTIVE) != 0) {
      add("error-active again");
      error.state = CanState::kActive;
    }
    if ((controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
      add("error warning: 96 errors counted");
      error.state = CanState::kWarning;
    }
    if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
      add("error-passive: 128 errors counted");
      error.state = CanState::kPassive;
    }
  }
  if ((id & CAN_ERR_BUSOFF) != 0) {
    add("bus-off: 256 errors counted");
    error.state = CanState::kBusOff;
  }
  if (error.text.empty()) error.text = "unspecified error";
  return error;
}

absl::StatusOr<std::unique_ptr<CanPort>> OpenSocketCan(const std::string& interface, Clock& clock) {
  const int socket = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  if (socket < 0) {
    return Error(absl::StatusCode::kFailedPrecondition, "CAN_UNSUPPORTED",
                 absl::StrCat("no CAN socket: ", std::generic_category().message(errno),
                              "; this kernel needs the modules can and can_raw"),
                 {{"interface", interface}});
  }
  auto fail = [&](absl::Status why) {
    close(socket);
    return why;
  };
  ifreq request{};
  interface.copy(request.ifr_name, IFNAMSIZ - 1);
  if (ioctl(socket, SIOCGIFINDEX, &request) != 0) {
    return fail(Lost(interface, "does not exist: is the adapter plugged in?"));
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  if (ioctl(socket, SIOCGIFFLAGS, &request) != 0) return fail(LostBy(interface, errno));
  if ((request.ifr_flags & IFF_UP) == 0) return fail(LostBy(interface, ENETDOWN));
  // A controller that went bus-off before says so by having no carrier.
  const CanState state =
      (request.ifr_flags & IFF_RUNNING) == 0 ? CanState::kBusOff : CanState::kActive;
  const can_err_mask_t errors = CAN_ERR_MASK;
  const int on = 1;
  if (setsockopt(socket, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0 ||
      setsockopt(socket, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0 ||
      bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return fail(LostBy(interface, errno));
  }
  return std::make_unique<SocketCanPort>(interface, socket, state, clock);
}

absl::StatusOr<std::vector<CanInterface>> ListCanInterfaces(const std::string& directory) {
  std::vector<CanInterface> found;
  std::error_code error;
  for (std::filesystem::directory_iterator it(directory, error), end; !error && it != end;
       it.increment(error)) {
    int type = 0;
    if (!(std::ifstream(it->path() / "type") >> type) || type != kCanType) continue;
    unsigned flags = 0;
    std::ifstream(it->path() / "flags") >> std::hex >> flags;
    found.push_back({it->path().filename().string(), (flags & IFF_UP) != 0});
  }
  if (error) {
    return Error(absl::StatusCode::kInternal, "IO",
                 absl::StrCat(directory, " can not be read: ", error.message()),
                 {{"path", directory}});
  }
  std::sort(found.begin(), found.end(),
            [](const CanInterface& a, const CanInterface& b) { return a.name < b.name; });
  return found;
}

}  // namespace lightstage::canopen
