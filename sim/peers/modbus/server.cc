#include "sim/peers/modbus/server.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "base/status.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr Duration kTick = milliseconds(2);
// A frame that has not gone on for so long is given up. The standard's 3.5 characters are nothing that a busy machine keeps.
constexpr Duration kFrameEnd = milliseconds(100);
constexpr size_t kMostBytes = 4096;

absl::Status NotStarted(const char* what) {
  return Error(absl::StatusCode::kUnavailable, "PEER_NOT_STARTED",
               absl::StrCat("the Modbus server: ", what, ": ", std::strerror(errno)));
}

}  // namespace

absl::StatusOr<std::unique_ptr<ModbusServer>> ModbusServer::StartTcp(Devices devices, int port) {
  std::unique_ptr<ModbusServer> server(new ModbusServer(std::move(devices)));
  server->tcp_ = true;
  server->port_ = port;
  RETURN_IF_ERROR(server->Plug());
  server->Start();
  return server;
}

absl::StatusOr<std::unique_ptr<ModbusServer>> ModbusServer::StartRtu(Devices devices,
                                                                     std::string link) {
  std::unique_ptr<ModbusServer> server(new ModbusServer(std::move(devices)));
  if (link.empty()) {
    std::string directory =
        (std::filesystem::temp_directory_path() / "lightstage-pty-XXXXXX").string();
    if (mkdtemp(directory.data()) == nullptr) return NotStarted("a folder for the terminal");
    server->directory_ = directory;
    link = directory + "/port";
  }
  // What an earlier one left may go, which leads nowhere now, and nothing else.
  std::error_code none;
  const std::filesystem::path there = std::filesystem::read_symlink(link, none);
  if (std::filesystem::exists(std::filesystem::symlink_status(link, none)) &&
      (there.parent_path() != "/dev/pts" || std::filesystem::exists(there, none))) {
    errno = EEXIST;
    return NotStarted(link.c_str());
  }
  server->link_ = std::move(link);
  RETURN_IF_ERROR(server->Plug());
  server->Start();
  return server;
}

ModbusServer::~ModbusServer() {
  quit_ = true;
  if (thread_.joinable()) thread_.join();
  Unplug();
  std::error_code ignored;
  if (!directory_.empty()) std::filesystem::remove_all(directory_, ignored);
}

void ModbusServer::Start() {
  thread_ = std::thread([this] { Run(); });
}

void ModbusServer::Inject(WireFault fault, int requests, int parameter, int skip) {
  MutexLock lock(&mutex_);
  fault_ = fault;
  times_ = requests;
  parameter_ = parameter;
  skip_ = skip;
}

void ModbusServer::Unplug() {
  MutexLock lock(&mutex_);
  CloseLocked();
}

absl::Status ModbusServer::Plug() {
  MutexLock lock(&mutex_);
  CloseLocked();
  return tcp_ ? Listen() : OpenPty();
}

void ModbusServer::CloseLocked() {
  for (Connection& connection : connections_) close(connection.fd);
  connections_.clear();
  if (listener_ >= 0) {
    // The other thread may be polling it, which keeps it listening beyond its closing.
    shutdown(listener_, SHUT_RDWR);
    close(listener_);
  }
  if (far_end_ >= 0) close(far_end_);
  listener_ = far_end_ = -1;
  std::error_code ignored;
  if (!link_.empty()) std::filesystem::remove(link_, ignored);
}

absl::Status ModbusServer::Listen() {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (listener_ < 0) return NotStarted("a socket");
  const int yes = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(port_));  // 0 at first: any
  socklen_t size = sizeof(address);
  if (bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      listen(listener_, 8) != 0 ||
      getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    const int error = errno;
    const std::string what = absl::StrCat("listening on 127.0.0.1:", port_,
                                          error == EADDRINUSE ? " (another server has it)" : "");
    errno = error;
    return NotStarted(what.c_str());
  }
  port_ = ntohs(address.sin_port);
  return absl::OkStatus();
}

absl::Status ModbusServer::OpenPty() {
  const int near = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (near < 0) return NotStarted("a pseudo-terminal");
  connections_.push_back({near, {}, {}});
  char name[128];
  if (grantpt(near) != 0 || unlockpt(near) != 0 || ptsname_r(near, name, sizeof(name)) != 0) {
    return NotStarted("a pseudo-terminal");
  }
  far_end_ = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  termios raw = {};
  if (far_end_ < 0 || tcgetattr(far_end_, &raw) != 0) return NotStarted(name);
  cfmakeraw(&raw);
  tcsetattr(far_end_, TCSANOW, &raw);
  if (symlink(name, link_.c_str()) != 0) return NotStarted(link_.c_str());
  return absl::OkStatus();
}

void ModbusServer::Run() {
  while (!quit_) {
    for (const auto& [unit, device] : devices_) device->Tick();
    Poll();
  }
}

void ModbusServer::Poll() {
  std::vector<pollfd> polled;
  {
    MutexLock lock(&mutex_);
    if (listener_ >= 0) polled.push_back({listener_, POLLIN, 0});
    for (const Connection& connection : connections_) {
      polled.push_back({connection.fd, POLLIN, 0});
    }
  }
  const int ready =
      poll(polled.data(), polled.size(), std::chrono::duration_cast<milliseconds>(kTick).count());
  if (ready <= 0) return;
  MutexLock lock(&mutex_);
  if (listener_ >= 0) Accept();
  // Everything is non-blocking: those that were not ready cost a call.
  for (size_t i = 0; i < connections_.size();) {
    if (Receive(connections_[i])) {
      ++i;
    } else {
      close(connections_[i].fd);
      connections_.erase(connections_.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }
}

void ModbusServer::Accept() {
  const int fd = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (fd < 0) return;
  const int yes = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
  connections_.push_back({fd, {}, {}});
}

bool ModbusServer::Receive(Connection& connection) {
  uint8_t bytes[512];
  const ssize_t count = read(connection.fd, bytes, sizeof(bytes));
  if (count < 0) return errno == EAGAIN || errno == EINTR || !tcp_;
  if (count == 0) return !tcp_;
  const TimePoint now = clock_.Now();
  if (!tcp_ && now - connection.last > kFrameEnd) connection.received.clear();
  connection.last = now;
  connection.received.insert(connection.received.end(), bytes, bytes + count);
  if (connection.received.size() > kMostBytes) connection.received.clear();
  while (tcp_ ? TakeTcp(connection) : TakeRtu(connection)) {
  }
  return true;
}

bool ModbusServer::TakeTcp(Connection& connection) {
  std::vector<uint8_t>& received = connection.received;
  const std::optional<MbapHeader> header = ParseMbap(received);
  if (!header) return false;
  if (header->protocol != 0 || header->length < 2 || header->length > 254) {
    received.clear();
    return false;
  }
  const size_t size = 6 + size_t{header->length};
  if (received.size() < size) return false;
  Answer(connection.fd, header->transaction, header->unit,
         std::span(received).subspan(MbapHeader::kSize, size - MbapHeader::kSize));
  received.erase(received.begin(), received.begin() + static_cast<std::ptrdiff_t>(size));
  return true;
}

bool ModbusServer::TakeRtu(Connection& connection) {
  std::vector<uint8_t>& received = connection.received;
  const std::optional<size_t> size = RtuRequestLength(received);
  if (!size) return false;
  if (*size == 0) {
    received.clear();
    return false;
  }
  if (received.size() < *size) return false;
  const std::span<const uint8_t> frame = std::span(received).first(*size);
  // A damaged request is not answered (MODBUS over Serial Line V1.02, 2.5.1.2).
  if (ModbusCrc(frame.first(*size - 2)) == (frame[*size - 2] | frame[*size - 1] << 8)) {
    Answer(connection.fd, -1, frame[0], frame.subspan(1, *size - 3));
  }
  received.erase(received.begin(), received.begin() + static_cast<std::ptrdiff_t>(*size));
  return true;
}

void ModbusServer::Answer(int fd, int transaction, int unit, std::span<const uint8_t> pdu) {
  ++requests_;
  const auto device = devices_.find(unit);
  if (device == devices_.end()) return;
  const ParsedRequest parsed = ParseRequest(unit, pdu);
  const bool counts =
      fault_ != WireFault::kSilentWrite || (parsed.request && parsed.request->writes());
  WireFault fault = WireFault::kNone;
  if (counts && skip_ > 0) {
    --skip_;
  } else if (counts && times_ > 0) {
    --times_;
    fault = fault_;
  }
  if (fault == WireFault::kSilence || fault == WireFault::kSilentWrite) return;
  std::vector<uint8_t> reply;
  if (fault == WireFault::kException || !parsed.request) {
    reply = ExceptionPdu(pdu.empty() ? 0 : pdu[0],
                         fault == WireFault::kException ? parameter_ : parsed.exception);
  } else {
    reply = ReplyPdu(*parsed.request, device->second->Handle(*parsed.request));
  }
  if (fault == WireFault::kLostReply) return;
  if (fault == WireFault::kOtherUnit) ++unit;
  std::vector<uint8_t> frame =
      tcp_ ? TcpFrame(static_cast<uint16_t>(transaction + (fault == WireFault::kGarbage)), unit,
                      reply)
           : RtuFrame(unit, reply);
  if (!tcp_ && fault == WireFault::kGarbage) frame[frame.size() - 1] ^= 0x55;
  if (fault == WireFault::kTruncated) frame.resize(frame.size() - 2);
  const Duration late = milliseconds(parameter_);
  if (fault != WireFault::kDribble) {
    return Send(fd, frame, fault == WireFault::kLate ? late : Duration::zero());
  }
  for (const uint8_t& byte : frame) Send(fd, {&byte, 1}, late);
}

void ModbusServer::Send(int fd, std::span<const uint8_t> frame, Duration late) {
  // A device that is late does nothing else meanwhile.
  if (late > Duration::zero()) SleepFor(clock_, late);
  const ssize_t sent = tcp_ ? send(fd, frame.data(), frame.size(), MSG_NOSIGNAL)
                            : write(fd, frame.data(), frame.size());
  static_cast<void>(sent);  // who has gone needs no answer
}

}  // namespace lightstage::sim
