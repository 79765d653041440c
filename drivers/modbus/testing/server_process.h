// For tests: a Modbus server of python3-pymodbus, which nobody of this project wrote, as a child process; over TCP on loopback, or behind a
// pair of pseudo-terminals that socat connects.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace lightstage {

// A child that ends with this object.
class ChildProcess {
 public:
  static absl::StatusOr<ChildProcess> Start(const std::vector<std::string>& command);
  ChildProcess(ChildProcess&& other) noexcept : pid_(other.pid_) { other.pid_ = -1; }
  ChildProcess& operator=(ChildProcess&&) = delete;
  ~ChildProcess() { Kill(); }

  void Kill();
  void Suspend(bool asleep);  // it is there, but does not answer

 private:
  explicit ChildProcess(pid_t pid) : pid_(pid) {}
  pid_t pid_;
};

class PymodbusServer {
 public:
  // On 127.0.0.1. Returns once it listens.
  static absl::StatusOr<PymodbusServer> StartTcp(int port);
  // Returns once it has opened its end of the line.
  static absl::StatusOr<PymodbusServer> StartRtu();
  PymodbusServer(PymodbusServer&& other) noexcept;
  PymodbusServer& operator=(PymodbusServer&&) = delete;
  ~PymodbusServer();

  // The near end of an RTU server's line, 115200 baud.
  std::string serial_port() const { return directory_ + "/near"; }
  ChildProcess& server() { return *server_; }
  ChildProcess& line() { return *line_; }  // socat

 private:
  PymodbusServer() = default;
  std::string directory_;
  std::optional<ChildProcess> line_, server_;
};

}  // namespace lightstage
