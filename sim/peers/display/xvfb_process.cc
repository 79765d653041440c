#include "sim/peers/display/xvfb_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "base/status.h"

extern char** environ;

namespace lightstage {
namespace {

constexpr int kDisplayNumber = 9;  // where the server writes the number of its display

// Starts a program that reads nothing and whose words nobody reads; `number`, if any, is its file kDisplayNumber.
absl::StatusOr<pid_t> Spawn(const std::vector<std::string>& arguments, int number) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) {
    argv.push_back(const_cast<char*>(argument.c_str()));
  }
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
  if (number >= 0) posix_spawn_file_actions_adddup2(&actions, number, kDisplayNumber);
  pid_t pid = -1;
  const int error = posix_spawnp(&pid, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return ErrnoError(error, "starting", arguments[0]);
  return pid;
}

// What a server says of itself once it listens, without the line's end; nothing if it does not listen.
std::string ReadNumber(int from) {
  std::string number;
  pollfd answer{from, POLLIN, 0};
  for (char c = 0; poll(&answer, 1, 30000) > 0 && read(from, &c, 1) == 1; number += c) {
    if (c == '\n') return number;
  }
  return "";
}

}  // namespace

absl::StatusOr<XvfbProcess> XvfbProcess::Start(const XvfbOptions& options) {
  XvfbProcess xvfb;
  xvfb.width_ = options.width;
  xvfb.height_ = options.height;
  std::string folder = (std::filesystem::temp_directory_path() / "lightstage-xvfb-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) return ErrnoError(errno, "making", folder);
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return ErrnoError(errno, "making", "a pipe");
  // setpriv: however this process ends, the server does too.
  std::vector<std::string> arguments = {
      "setpriv", "--pdeathsig", "KILL",
      "Xvfb",    "-displayfd",  absl::StrCat(kDisplayNumber),
      "-screen", "0",           absl::StrCat(options.width, "x", options.height, "x24"),
      "-fbdir",  folder,        "-nolisten",
      "tcp",     "-noreset"};
  if (!options.display.empty()) arguments.push_back(options.display);
  if (!options.cursor) arguments.emplace_back("-nocursor");
  const absl::StatusOr<pid_t> pid = Spawn(arguments, ends[1]);
  close(ends[1]);
  std::string number;
  if (pid.ok()) {
    xvfb.pid_ = *pid;
    number = ReadNumber(ends[0]);
  }
  close(ends[0]);
  const absl::Status mapped =
      number.empty() ? Error(absl::StatusCode::kUnavailable, "PEER_NOT_STARTED",
                             absl::StrCat("Xvfb (package xvfb) does not listen on ",
                                          options.display.empty() ? "any display" : options.display,
                                          ": is another X server there?"))
                     : xvfb.MapScreen(folder);
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);  // the map is enough
  RETURN_IF_ERROR(pid.status());
  RETURN_IF_ERROR(mapped);
  xvfb.display_ = ":" + number;
  return xvfb;
}

absl::Status XvfbProcess::MapScreen(const std::string& folder) {
  const std::string path = folder + "/Xvfb_screen0";
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  void* map = MAP_FAILED;
  if (file >= 0 && fstat(file, &status) == 0) {
    map = mmap(nullptr, static_cast<size_t>(status.st_size), PROT_READ, MAP_SHARED, file, 0);
  }
  const int error = errno;
  if (file >= 0) close(file);
  if (map == MAP_FAILED) return ErrnoError(error, "mapping", path);
  screen_ = {static_cast<const uint8_t*>(map), static_cast<size_t>(status.st_size)};
  return absl::OkStatus();
}

XvfbProcess::XvfbProcess(XvfbProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)),
      display_(std::move(other.display_)),
      width_(other.width_),
      height_(other.height_),
      screen_(std::exchange(other.screen_, {})) {}

XvfbProcess::~XvfbProcess() {
  Kill();
  if (!screen_.empty()) munmap(const_cast<uint8_t*>(screen_.data()), screen_.size());
}

bool XvfbProcess::Alive() {
  if (pid_ >= 0 && waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
  return pid_ >= 0;
}

void XvfbProcess::Kill() {
  if (pid_ < 0) return;  // what has the number now may be another's
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
  if (display_.empty()) return;
  // What it would have removed itself.
  const std::string number = display_.substr(1);
  unlink(("/tmp/.X" + number + "-lock").c_str());
  unlink(("/tmp/.X11-unix/X" + number).c_str());
}

void XvfbProcess::Suspend(bool asleep) {
  kill(pid_, asleep ? SIGSTOP : SIGCONT);
  if (asleep) waitpid(pid_, nullptr, WUNTRACED);  // until it has really stopped
}

absl::Status XvfbProcess::SwitchOff() {
  // Without a size its screen would be of none, which the server refuses.
  return Xrandr({"--output", "screen", "--off", "--fb", absl::StrCat(width_, "x", height_)});
}

absl::Status XvfbProcess::ChangeMode() {
  const std::string w = absl::StrCat(width_ - 1), h = absl::StrCat(height_);
  // It may know the mode from the last time; whether it can be set is what counts.
  Xrandr({"--newmode", "narrower", "1", w, w, w, w, h, h, h, h}).IgnoreError();
  Xrandr({"--addmode", "screen", "narrower"}).IgnoreError();
  return Xrandr({"--output", "screen", "--mode", "narrower"});
}

absl::Status XvfbProcess::Restore() {
  return Xrandr({"--output", "screen", "--mode", absl::StrCat(width_, "x", height_)});
}

absl::Status XvfbProcess::Xrandr(const std::vector<std::string>& arguments) {
  std::vector<std::string> command = {"xrandr", "--display", display_};
  command.insert(command.end(), arguments.begin(), arguments.end());
  ASSIGN_OR_RETURN(const pid_t pid, Spawn(command, -1));
  int status = 0;
  if (waitpid(pid, &status, 0) == pid && WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    return absl::OkStatus();
  }
  return Error(absl::StatusCode::kFailedPrecondition, "PEER_XRANDR",
               absl::StrCat(absl::StrJoin(command, " "), " failed"));
}

}  // namespace lightstage
