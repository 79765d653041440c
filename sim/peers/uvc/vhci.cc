#include "sim/peers/uvc/vhci.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "base/clock.h"
#include "base/env.h"
#include "base/status.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr char kController[] = "/sys/devices/platform/vhci_hcd.0/";
constexpr int kHighSpeed = 3;  // enum usb_device_speed
constexpr int kDeviceId =
    1 << 16;  // bus and number where a real device would be: said back to us, and not used

absl::Status NotStarted(std::string_view why) {
  return Error(absl::StatusCode::kUnavailable, "PEER_NOT_STARTED",
               absl::StrCat("the simulated USB device: ", why));
}

std::string PathOf(const char* file) { return absl::StrCat(kController, file); }

absl::StatusOr<std::string> Status() {
  absl::StatusOr<std::string> text = PosixEnv().ReadInput(PathOf("status"));
  if (!text.ok()) {
    return NotStarted(absl::StrCat(MessageOf(text.status()), " (modprobe vhci-hcd)"));
  }
  return text;
}

// 0 or errno.
int Tell(const char* file, const std::string& text) {
  const int fd = open(PathOf(file).c_str(), O_WRONLY | O_CLOEXEC);
  if (fd < 0) return errno;
  const bool good = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = good ? 0 : errno;
  close(fd);
  return error;
}

}  // namespace

// hub port sta spd dev      sockfd local_busid
// hs  0000 004 000 00000000 000000 0-0
std::optional<int> FreeVhciPort(std::string_view status, std::optional<int> port) {
  constexpr int kFree = 4;  // VDEV_ST_NULL
  const absl::string_view text(status.data(), status.size());
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    const std::vector<std::string> words = absl::StrSplit(line, ' ', absl::SkipEmpty());
    int number = 0, state = 0;
    if (words.size() < 3 || words[0] != "hs" || !absl::SimpleAtoi(words[1], &number) ||
        !absl::SimpleAtoi(words[2], &state)) {
      continue;
    }
    if (state == kFree && port.value_or(number) == number) return number;
  }
  return std::nullopt;
}

absl::StatusOr<VhciPlug> PlugIntoVhci(std::optional<int> port) {
  // Somebody else may take it in between.
  constexpr int kAttempts = 10;
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return NotStarted(absl::StrCat("socketpair: ", std::strerror(errno)));
  }
  absl::Status failed;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const absl::StatusOr<std::string> status = Status();
    if (!status.ok()) {
      failed = status.status();
      break;
    }
    const std::optional<int> free = FreeVhciPort(*status, port);
    if (!free) {
      failed = NotStarted(port ? absl::StrFormat("port %d of %s is taken", *port, kController)
                               : absl::StrCat("no port of ", kController, " is free"));
      break;
    }
    const int error =
        Tell("attach", absl::StrFormat("%d %d %d %d", *free, ends[1], kDeviceId, kHighSpeed));
    if (error == 0) {
      close(ends[1]);  // the kernel has its own
      return VhciPlug{*free, ends[0]};
    }
    failed = NotStarted(
        absl::StrFormat("%s: port %d: %s", PathOf("attach"), *free, std::strerror(error)));
    if (error != EBUSY) break;
  }
  close(ends[0]);
  close(ends[1]);
  return failed;
}

absl::Status AwaitVhciPort(int port) {
  RealClock clock;
  const TimePoint give_up = clock.Now() + seconds(10);
  while (true) {
    ASSIGN_OR_RETURN(const std::string status, Status());
    if (FreeVhciPort(status, port)) return absl::OkStatus();
    if (clock.Now() > give_up) {
      return NotStarted(absl::StrFormat("port %d of %s stays taken", port, kController));
    }
    SleepFor(clock, milliseconds(10));
  }
}

}  // namespace lightstage::sim
