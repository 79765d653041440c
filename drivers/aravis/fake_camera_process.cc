#include "drivers/aravis/fake_camera_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "base/status.h"

extern char** environ;

namespace lightstage {
namespace {

// Whether some socket of this network namespace is bound to GigE Vision's control port, 3956.
bool SomebodyListens() {
  std::ifstream udp("/proc/self/net/udp");
  for (std::string line; std::getline(udp, line);) {
    if (line.find("0100007F:0F74 ") != std::string::npos) return true;
  }
  return false;
}

}  // namespace

absl::StatusOr<FakeCameraProcess> FakeCameraProcess::Start(const std::string& serial,
                                                           int lost_per_mille) {
  std::string lost = std::to_string(lost_per_mille);
  std::string program = "arv-fake-gv-camera-0.8";
  const char* arguments[] = {program.c_str(), "-i", kAddress,     "-s",
                             serial.c_str(),  "-r", lost.c_str(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  pid_t pid = -1;
  int error = posix_spawnp(&pid, program.c_str(), &actions, nullptr,
                           const_cast<char* const*>(arguments), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return ErrnoError(error, "starting", program + " (package aravis-tools-cli)");
  FakeCameraProcess process(pid);
  auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!SomebodyListens()) {
    if (std::chrono::steady_clock::now() > give_up) {
      return Error(absl::StatusCode::kDeadlineExceeded, "PEER_SILENT",
                   program + " does not listen on port 3956");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return process;
}

void FakeCameraProcess::Kill() {
  if (pid_ < 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

void FakeCameraProcess::Suspend(bool asleep) {
  kill(pid_, asleep ? SIGSTOP : SIGCONT);
  if (asleep) waitpid(pid_, nullptr, WUNTRACED);  // until it has really stopped
}

}  // namespace lightstage
