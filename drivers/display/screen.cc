#include "drivers/display/screen.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "base/status.h"

extern char** environ;

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Steady = std::chrono::steady_clock;

// For a server that may hang; kmsdrm has none, and a GL that may have its shaders to compile.
Duration OpenPatience(const std::string& backend) { return seconds(backend == "kmsdrm" ? 30 : 8); }
constexpr Duration kClosePatience = seconds(2);

class Fd {
 public:
  explicit Fd(int fd = -1) : fd_(fd) {}
  Fd(Fd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Fd& operator=(Fd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~Fd() {
    if (fd_ >= 0) close(fd_);
  }
  int get() const { return fd_; }

 private:
  int fd_;
};

// The same file at a number that the child does not use for its own ends.
absl::StatusOr<Fd> MovedUp(Fd fd) {
  const int up = fcntl(fd.get(), F_DUPFD_CLOEXEC, 10);
  if (up < 0) return ErrnoError(errno, "duplicating", "a file descriptor");
  return Fd(up);
}

absl::StatusOr<std::string> Program() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path program = self.parent_path() / "lightstage-screen";
  if (error || !std::filesystem::exists(program, error)) {
    return Error(
        absl::StatusCode::kFailedPrecondition, "SCREEN_PROGRAM_MISSING",
        absl::StrCat("the program lightstage-screen must stand beside this one: there is no ",
                     program.string()),
        {{"path", program.string()}});
  }
  return program.string();
}

absl::Status Silent(std::string_view what, Duration patience) {
  return Error(
      absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
      absl::StrCat("the display did not confirm ", what, " within ", Seconds(patience), " s"),
      {{"operation", std::string(what)}});
}

}  // namespace

// The running program and both ends of what is shared with it.
class Screen::Child {
 public:
  // `bytes` of shared memory, if any.
  static absl::StatusOr<std::unique_ptr<Child>> Start(std::vector<std::string> arguments,
                                                      size_t bytes) {
    ASSIGN_OR_RETURN(std::string program, Program());
    arguments.insert(arguments.begin(), program);
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) {
      return ErrnoError(errno, "making", "a socket pair");
    }
    auto child = std::unique_ptr<Child>(new Child);
    child->socket_ = Fd(ends[0]);
    ASSIGN_OR_RETURN(Fd theirs, MovedUp(Fd(ends[1])));
    Fd memory(memfd_create("lightstage-screen", MFD_CLOEXEC));
    if (memory.get() < 0 || ftruncate(memory.get(), static_cast<off_t>(bytes)) != 0) {
      return ErrnoError(errno, "making", "shared memory for a screen");
    }
    ASSIGN_OR_RETURN(memory, MovedUp(std::move(memory)));
    if (bytes > 0) {
      void* mapped = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memory.get(), 0);
      if (mapped == MAP_FAILED) return ErrnoError(errno, "mapping", "shared memory for a screen");
      child->pixels_ = {static_cast<uint32_t*>(mapped), bytes / sizeof(uint32_t)};
    }
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, theirs.get(), kScreenSocket);
    posix_spawn_file_actions_adddup2(&actions, memory.get(), kScreenMemory);
    const int error =
        posix_spawn(&child->pid_, program.c_str(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
      child->pid_ = -1;
      return ErrnoError(error, "starting", program);
    }
    return child;
  }

  // It goes black and ends when its socket is closed.
  ~Child() {
    socket_ = Fd();
    Reap(kClosePatience);
    if (pixels_.data() != nullptr) munmap(pixels_.data(), pixels_.size_bytes());
  }

  std::span<uint32_t> pixels() const { return pixels_; }

  absl::Status Ask(char request) {
    if (send(socket_.get(), &request, 1, MSG_NOSIGNAL) == 1) return absl::OkStatus();
    return Gone();
  }

  // Its next reply. OUT_OF_RANGE / SCREEN_CLOSED if it ended well.
  absl::StatusOr<ScreenInfo> Reply(std::string_view what, Duration patience) {
    const Steady::time_point give_up = Steady::now() + patience;
    pollfd socket{socket_.get(), POLLIN, 0};
    while (true) {
      const auto left = std::chrono::ceil<milliseconds>(give_up - Steady::now()).count();
      const int ready = poll(&socket, 1, static_cast<int>(std::max<int64_t>(left, 0)));
      if (ready > 0) break;
      if (ready == 0) {
        kill(pid_, SIGKILL);  // it hangs, and would do so on closing too
        return Silent(what, patience);
      }
      if (errno != EINTR) return ErrnoError(errno, "waiting for", "the screen process");
    }
    std::string text(kMaxScreenReply, '\0');
    const ssize_t size = recv(socket_.get(), text.data(), text.size(), 0);
    if (size <= 0) return Gone();
    text.resize(static_cast<size_t>(size));
    return ParseScreenReply(text);
  }

 private:
  Child() = default;

  // Why there is nothing more to be had from it.
  absl::Status Gone() {
    const int ended = Reap(milliseconds(500));
    if (WIFEXITED(ended) && WEXITSTATUS(ended) == 0) {
      return Error(absl::StatusCode::kOutOfRange, "SCREEN_CLOSED", "the screen process has ended");
    }
    const std::string how =
        WIFEXITED(ended) && WEXITSTATUS(ended) == kDisplayGoneExit
            ? std::string("the connection to the X server broke")
        : WIFEXITED(ended) ? absl::StrCat("the screen process exited with ", WEXITSTATUS(ended))
                           : absl::StrCat("the screen process ended with signal ", WTERMSIG(ended));
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                 absl::StrCat("the display is gone: ", how), {{"cause", how}});
  }

  // Waits for its end, then ends it.
  int Reap(Duration patience) {
    if (pid_ < 0) return ended_;
    const Steady::time_point give_up = Steady::now() + patience;
    while (waitpid(pid_, &ended_, WNOHANG) == 0) {
      if (Steady::now() > give_up) {
        kill(pid_, SIGKILL);
        waitpid(pid_, &ended_, 0);
        break;
      }
      std::this_thread::sleep_for(milliseconds(2));
    }
    pid_ = -1;
    return ended_;
  }

  Fd socket_;
  pid_t pid_ = -1;
  int ended_ = 0;
  std::span<uint32_t> pixels_;
};

Screen::Screen(std::unique_ptr<Child> child, int width, int height, Duration patience)
    : child_(std::move(child)), width_(width), height_(height), patience_(patience) {}

Screen::~Screen() = default;

absl::StatusOr<std::unique_ptr<Screen>> Screen::Open(const ScreenOptions& options, int width,
                                                     int height) {
  if (width < 1 || height < 1 || width > 32768 || height > 32768) {
    return Error(absl::StatusCode::kInvalidArgument, "DEVICE_UNSUITABLE",
                 absl::StrCat("a screen of ", width, "x", height, " pixels is not possible"),
                 {{"width", absl::StrCat(width)}, {"height", absl::StrCat(height)}});
  }
  const size_t bytes = static_cast<size_t>(width) * height * sizeof(uint32_t);
  ASSIGN_OR_RETURN(
      std::unique_ptr<Child> child,
      Child::Start({"show", options.backend, options.x_display, options.output,
                    absl::StrCat(options.output_index), options.renderer,
                    absl::StrCat(options.frames), absl::StrCat(width), absl::StrCat(height)},
                   bytes));
  // A frame takes a fiftieth of a second or less, except where nothing paces and the machine is busy.
  const Duration patience = seconds(1) + options.frames * milliseconds(50);
  std::unique_ptr<Screen> screen(new Screen(std::move(child), width, height, patience));
  ASSIGN_OR_RETURN(screen->info_,
                   screen->child_->Reply("that it is open", OpenPatience(options.backend)));
  return screen;
}

absl::StatusOr<std::vector<ScreenInfo>> Screen::ListOutputs(const ScreenOptions& options) {
  ASSIGN_OR_RETURN(std::unique_ptr<Child> child,
                   Child::Start({"list", options.backend, options.x_display}, 0));
  std::vector<ScreenInfo> outputs;
  while (true) {
    absl::StatusOr<ScreenInfo> output = child->Reply("its outputs", OpenPatience(options.backend));
    if (ErrorReason(output.status()) == "SCREEN_CLOSED") return outputs;
    if (!output.ok()) return output.status();
    outputs.push_back(*std::move(output));
  }
}

absl::Status Screen::Show(std::span<const uint8_t> raster, int channels) {
  const size_t count = static_cast<size_t>(width_) * height_;
  if ((channels != 1 && channels != 3) || raster.size() != count * channels) {
    return Error(absl::StatusCode::kInvalidArgument, "RASTER",
                 absl::StrCat("a raster of ", raster.size(), " bytes with ", channels,
                              " channels is none of ", width_, "x", height_, " pixels"));
  }
  if (child_ == nullptr) {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "the screen is closed");
  }
  std::span<uint32_t> pixels = child_->pixels();
  for (size_t i = 0; i < count; ++i) {
    const uint8_t* p = raster.data() + i * channels;
    const uint32_t r = p[0], g = p[channels == 3 ? 1 : 0], b = p[channels == 3 ? 2 : 0];
    pixels[i] = r << 16 | g << 8 | b;
  }
  return Ask(kShowRequest);
}

absl::Status Screen::Check() { return Ask(kCheckRequest); }

absl::Status Screen::Ask(char request) {
  if (child_ == nullptr)
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "it is closed");
  absl::Status answered = child_->Ask(request);
  if (answered.ok()) answered = child_->Reply("the picture", patience_).status();
  // A process that ends of itself while it is wanted has lost its display too.
  if (ErrorReason(answered) == "SCREEN_CLOSED") {
    answered = Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", MessageOf(answered));
  }
  if (!answered.ok() && ErrorReason(answered) != "DEVICE_FAULT") child_.reset();
  return answered;
}

}  // namespace lightstage
