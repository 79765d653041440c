#include "drivers/modbus/testing/server_process.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>
#include <utility>

#include "absl/functional/function_ref.h"
#include "base/status.h"

extern char** environ;

namespace lightstage {
namespace {

// Debian's Python packages belong to this interpreter, whatever python3 is on the PATH.
constexpr char kPython[] = "/usr/bin/python3";
constexpr char kServer[] = LIGHTSTAGE_SOURCE_DIR "/drivers/modbus/testing/modbus_server.py";

absl::Status Await(absl::FunctionRef<bool()> ready, const char* what) {
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!ready()) {
    if (std::chrono::steady_clock::now() > give_up) {
      return Error(absl::StatusCode::kDeadlineExceeded, "PEER_SILENT",
                   absl::StrCat(what,
                                " has not started; it needs python3-pymodbus, "
                                "python3-serial-asyncio and socat"));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return absl::OkStatus();
}

bool Listens(int port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const bool listens =
      connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  close(fd);
  return listens;
}

// Whether it answers a read of holding register 0 of unit 1 over the line.
bool Answers(const std::string& serial_port) {
  constexpr unsigned char kRead[] = {0x01, 0x03, 0x00, 0x00, 0x00, 0x01, 0x84, 0x0A};
  const int fd = open(serial_port.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return false;
  unsigned char reply[16];
  bool answers = false;
  if (write(fd, kRead, sizeof(kRead)) == sizeof(kRead)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    answers = read(fd, reply, sizeof(reply)) == 7;
  }
  close(fd);
  return answers;
}

}  // namespace

absl::StatusOr<ChildProcess> ChildProcess::Start(const std::vector<std::string>& command) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", O_WRONLY, 0);
  pid_t pid = -1;
  const int error = posix_spawnp(&pid, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return ErrnoError(error, "starting", command[0]);
  return ChildProcess(pid);
}

void ChildProcess::Kill() {
  if (pid_ < 0) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

void ChildProcess::Suspend(bool asleep) {
  kill(pid_, asleep ? SIGSTOP : SIGCONT);
  if (asleep) waitpid(pid_, nullptr, WUNTRACED);  // until it has really stopped
}

absl::StatusOr<PymodbusServer> PymodbusServer::StartTcp(int port) {
  PymodbusServer started;
  ASSIGN_OR_RETURN(ChildProcess server,
                   ChildProcess::Start({kPython, kServer, "tcp", std::to_string(port)}));
  started.server_.emplace(std::move(server));
  RETURN_IF_ERROR(Await([&] { return Listens(port); }, kServer));
  return started;
}

absl::StatusOr<PymodbusServer> PymodbusServer::StartRtu() {
  PymodbusServer started;
  std::string directory =
      (std::filesystem::temp_directory_path() / "lightstage-modbus-XXXXXX").string();
  if (mkdtemp(directory.data()) == nullptr) return ErrnoError(errno, "making", directory);
  started.directory_ = directory;
  const std::string far = directory + "/far";
  ASSIGN_OR_RETURN(ChildProcess line,
                   ChildProcess::Start({"socat", "pty,raw,echo=0,link=" + started.serial_port(),
                                        "pty,raw,echo=0,link=" + far}));
  started.line_.emplace(std::move(line));
  RETURN_IF_ERROR(Await(
      [&] {
        return std::filesystem::exists(started.serial_port()) && std::filesystem::exists(far);
      },
      "socat"));
  ASSIGN_OR_RETURN(ChildProcess server, ChildProcess::Start({kPython, kServer, "rtu", far}));
  started.server_.emplace(std::move(server));
  RETURN_IF_ERROR(Await([&] { return Answers(started.serial_port()); }, kServer));
  return started;
}

PymodbusServer::PymodbusServer(PymodbusServer&& other) noexcept
    : directory_(std::exchange(other.directory_, {})),
      line_(std::move(other.line_)),
      server_(std::move(other.server_)) {}

PymodbusServer::~PymodbusServer() {
  server_.reset();
  line_.reset();
  std::error_code ignored;
  if (!directory_.empty()) std::filesystem::remove_all(directory_, ignored);
}

}  // namespace lightstage
