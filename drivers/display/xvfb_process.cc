#include "drivers/display/xvfb_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "base/status.h"

extern char** environ;

namespace lightstage {

absl::StatusOr<XvfbProcess> XvfbProcess::Start(int width, int height, bool cursor) {
  XvfbProcess xvfb;
  std::string folder = (std::filesystem::temp_directory_path() / "lightstage-xvfb-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) return ErrnoError(errno, "making", folder);
  xvfb.folder_ = folder;
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return ErrnoError(errno, "making", "a pipe");
  const std::string screen = absl::StrCat(width, "x", height, "x24");
  const char* arguments[] = {
      "Xvfb",   "-displayfd",   "9",         "-screen", "0",        screen.c_str(),
      "-fbdir", folder.c_str(), "-nolisten", "tcp",     "-noreset", cursor ? nullptr : "-nocursor",
      nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], 9);
  const int error = posix_spawnp(&xvfb.pid_, "Xvfb", &actions, nullptr,
                                 const_cast<char* const*>(arguments), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  std::string number;
  pollfd answer{ends[0], POLLIN, 0};
  while (error == 0 && (number.empty() || number.back() != '\n') && poll(&answer, 1, 30000) > 0) {
    char c = 0;
    if (read(ends[0], &c, 1) != 1) break;
    number += c;
  }
  close(ends[0]);
  if (error != 0) {
    xvfb.pid_ = -1;
    return ErrnoError(error, "starting", "Xvfb (package xvfb)");
  }
  if (number.empty() || number.back() != '\n') {
    return Error(absl::StatusCode::kDeadlineExceeded, "PEER_SILENT", "Xvfb does not listen");
  }
  number.pop_back();
  xvfb.display_ = ":" + number;
  return xvfb;
}

XvfbProcess::XvfbProcess(XvfbProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)),
      display_(std::move(other.display_)),
      folder_(std::exchange(other.folder_, {})) {}

XvfbProcess::~XvfbProcess() {
  Kill();
  if (!folder_.empty()) {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
}

absl::StatusOr<XwdPicture> XvfbProcess::Picture() const {
  std::ifstream in(folder_ + "/Xvfb_screen0", std::ios::binary);
  std::vector<char> bytes{std::istreambuf_iterator<char>(in), {}};
  return ParseXwd({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()});
}

void XvfbProcess::Kill() {
  if (pid_ < 0) return;
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

}  // namespace lightstage
