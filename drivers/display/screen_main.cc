// lightstage-screen: owns one window for drivers/display/screen.h, which starts it and says what it wants through a socket.
//
//   lightstage-screen show BACKEND X_DISPLAY OUTPUT OUTPUT_INDEX RENDERER FRAMES WIDTH HEIGHT
//   lightstage-screen list BACKEND X_DISPLAY
//
// It ends, black, when the socket is closed: also when whoever started it is dead.
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <optional>
#include <vector>

#include "base/status.h"
#include "drivers/display/sdl_output.h"

namespace lightstage {
namespace {

constexpr int kIdlePollMs = 200;

// False if nobody listens any more.
bool Say(const absl::StatusOr<ScreenInfo>& reply) {
  const std::string text = EncodeScreenReply(reply);
  return send(kScreenSocket, text.data(), text.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(text.size());
}

int List(const std::string& backend, const std::string& x_display) {
  absl::StatusOr<std::vector<ScreenInfo>> outputs = SdlOutput::List(backend, x_display);
  if (!outputs.ok()) {
    Say(outputs.status());
    return 0;
  }
  for (const ScreenInfo& output : *outputs) Say(output);
  return 0;
}

int Show(const OutputOptions& options) {
  const size_t count = static_cast<size_t>(options.width) * options.height;
  void* memory = mmap(nullptr, count * 4, PROT_READ, MAP_SHARED, kScreenMemory, 0);
  if (memory == MAP_FAILED) {
    Say(ErrnoError(errno, "mapping", "the picture's shared memory"));
    return 0;
  }
  const std::span<const uint32_t> pixels(static_cast<const uint32_t*>(memory), count);
  absl::StatusOr<std::unique_ptr<SdlOutput>> output = SdlOutput::Open(options);
  if (!output.ok()) {
    Say(output.status());
    return 0;
  }
  if (!Say((*output)->info())) return 0;
  absl::Status idle;  // the first thing that went wrong while nobody asked
  while (true) {
    pollfd socket{kScreenSocket, POLLIN, 0};
    const int ready = poll(&socket, 1, kIdlePollMs);
    if (ready < 0 && errno != EINTR) break;
    if (ready <= 0) {
      if (idle.ok()) {
        idle = (*output)->Idle();
        if (!idle.ok()) {
          std::fprintf(stderr, "lightstage-screen: %s\n", MessageOf(idle).c_str());
        }
      }
      continue;
    }
    char request = 0;
    if (recv(kScreenSocket, &request, 1, 0) != 1) break;
    absl::Status shown = idle;
    if (shown.ok()) shown = request == kCheckRequest ? (*output)->Check() : (*output)->Show(pixels);
    // Of another picture nothing is known yet.
    if (request == kCheckRequest && ErrorReason(shown) != "DEVICE_FAULT") idle = shown;
    if (!Say(shown.ok() ? absl::StatusOr<ScreenInfo>((*output)->info()) : shown)) break;
  }
  if (absl::Status black = (*output)->Show(std::vector<uint32_t>(count, 0));
      !black.ok() && idle.ok()) {
    std::fprintf(stderr, "lightstage-screen: may not be black on closing: %s\n",
                 MessageOf(black).c_str());
  }
  output->reset();
  return 0;
}

std::optional<int> Number(const char* text) {
  int value = 0;
  const char* end = text + std::strlen(text);
  auto [stop, error] = std::from_chars(text, end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

int Main(int argc, char** argv) {
  close_range(kScreenMemory + 1, ~0U, 0);
  // Who started it says when it ends, and is to see it black then: not the terminal, nor systemd, which tell all processes.
  for (int ignored : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) signal(ignored, SIG_IGN);
  if (argc == 4 && std::strcmp(argv[1], "list") == 0) return List(argv[2], argv[3]);
  if (argc == 10 && std::strcmp(argv[1], "show") == 0) {
    std::optional<int> index = Number(argv[5]), frames = Number(argv[7]), width = Number(argv[8]),
                       height = Number(argv[9]);
    if (index && frames && width && height && *frames > 0 && *width > 0 && *height > 0) {
      return Show({argv[2], argv[3], argv[4], argv[6], *index, *frames, *width, *height});
    }
  }
  std::fprintf(stderr, "lightstage-screen is started by lightstaged's driver \"display\"\n");
  return 2;
}

}  // namespace
}  // namespace lightstage

int main(int argc, char** argv) {
  // At once: what SDL's libraries would do on exit may wait for a server that is gone, and what they hold needs no freeing.
  _exit(lightstage::Main(argc, argv));
}
