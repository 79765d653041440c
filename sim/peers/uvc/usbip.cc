#include "sim/peers/uvc/usbip.h"

#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage::sim {
namespace {

constexpr uint32_t kSubmitAnswer = 3, kUnlinkAnswer = 4;
// The kernel's buffers are smaller; whatever is longer is no length.
constexpr uint32_t kMostBytes = 1 << 20;
constexpr uint32_t kNotIsochronous = 0xffffffff;  // so the document; the kernel says 0

uint32_t Get(const UsbipHeader& header, size_t at) {
  return uint32_t{header[at]} << 24 | uint32_t{header[at + 1]} << 16 |
         uint32_t{header[at + 2]} << 8 | uint32_t{header[at + 3]};
}

void Put(UsbipHeader& header, size_t at, uint32_t value) {
  for (size_t i = 0; i < 4; ++i) header[at + i] = static_cast<uint8_t>(value >> (24 - 8 * i));
}

absl::Status Malformed(const char* field, uint32_t value, const char* right) {
  return Error(absl::StatusCode::kInvalidArgument, "USBIP_MALFORMED",
               absl::StrFormat("USB/IP: %s is %u, must be %s", field, value, right),
               {{"field", field}, {"value", absl::StrCat(value)}});
}

absl::Status ReadAll(int socket, std::span<uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = recv(socket, bytes.data(), bytes.size(), 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      return Error(absl::StatusCode::kUnavailable, "USBIP_CLOSED",
                   "USB/IP: the host has closed the connection");
    }
    bytes = bytes.subspan(static_cast<size_t>(count));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<UsbipCommand> ParseUsbipCommand(const UsbipHeader& header) {
  UsbipCommand command;
  const uint32_t kind = Get(header, 0);
  command.seqnum = Get(header, 4);
  if (kind == static_cast<uint32_t>(UsbipCommand::Kind::kUnlink)) {
    command.kind = UsbipCommand::Kind::kUnlink;
    command.unlinked = Get(header, 20);
    return command;
  }
  if (kind != static_cast<uint32_t>(UsbipCommand::Kind::kSubmit)) {
    return Malformed("command", kind, "1 (submit) or 2 (unlink)");
  }
  const uint32_t direction = Get(header, 12), endpoint = Get(header, 16), packets = Get(header, 32);
  command.length = Get(header, 24);
  if (direction > 1) return Malformed("direction", direction, "0 (out) or 1 (in)");
  if (endpoint > 15) return Malformed("ep", endpoint, "at most 15");
  if (command.length > kMostBytes) {
    return Malformed("transfer_buffer_length", command.length, "at most 1048576");
  }
  if (packets != 0 && packets != kNotIsochronous) {
    return Malformed("number_of_packets", packets, "0: nothing here is isochronous");
  }
  command.in = direction == 1;
  command.endpoint = static_cast<uint8_t>(endpoint);
  const auto word = [&](size_t at) {
    return static_cast<uint16_t>(header[at] | header[at + 1] << 8);  // as on the bus
  };
  command.setup = {header[40], header[41], word(42), word(44), word(46)};
  return command;
}

UsbipHeader UsbipSubmitAnswer(uint32_t seqnum, int status, uint32_t actual) {
  UsbipHeader header = {};
  Put(header, 0, kSubmitAnswer);
  Put(header, 4, seqnum);
  Put(header, 20, static_cast<uint32_t>(status));
  Put(header, 24, actual);
  return header;
}

UsbipHeader UsbipUnlinkAnswer(uint32_t seqnum, int status) {
  UsbipHeader header = {};
  Put(header, 0, kUnlinkAnswer);
  Put(header, 4, seqnum);
  Put(header, 20, static_cast<uint32_t>(status));
  return header;
}

UsbipConnection::UsbipConnection(int socket, UsbFunction& function, uint8_t bulk_in)
    : socket_(socket), function_(function), bulk_in_(bulk_in), thread_([this] { Run(); }) {}

UsbipConnection::~UsbipConnection() {
  shutdown(socket_, SHUT_RDWR);
  thread_.join();
  close(socket_);
}

// ---- The bulk endpoint

bool UsbipConnection::Ready(size_t count, absl::FunctionRef<bool()> cancelled) {
  while (!over_ && !cancelled() && waiting_.size() < count) changed_.Wait(&mutex_);
  return !over_ && !cancelled();
}

bool UsbipConnection::Send(std::span<const uint8_t> transfer, size_t most,
                           absl::FunctionRef<bool()> cancelled) {
  for (std::span<const uint8_t> rest = transfer;;) {
    MutexLock lock(&mutex_);
    if (!Ready(1, cancelled)) return false;
    const Request request = waiting_.front();
    waiting_.pop_front();
    const size_t part = std::min<size_t>(request.length, rest.size());
    Write(UsbipSubmitAnswer(request.seqnum, 0, static_cast<uint32_t>(part)), rest.first(part));
    rest = rest.subspan(part);
    // One that filled the host's buffer to its end is followed by an empty packet.
    if (rest.empty() && (part < request.length || transfer.size() == most)) return true;
  }
}

bool UsbipConnection::AwaitRequests(size_t count, absl::FunctionRef<bool()> cancelled) {
  MutexLock lock(&mutex_);
  return Ready(count, cancelled);
}

size_t UsbipConnection::requests() const {
  MutexLock lock(&mutex_);
  return waiting_.size();
}

void UsbipConnection::Wake() {
  MutexLock lock(&mutex_);
  changed_.SignalAll();
}

void UsbipConnection::FailRequests(int error) {
  MutexLock lock(&mutex_);
  for (const Request& request : waiting_) Write(UsbipSubmitAnswer(request.seqnum, -error, 0));
  waiting_.clear();
  changed_.SignalAll();
}

absl::Status UsbipConnection::status() const {
  MutexLock lock(&mutex_);
  return ended_;
}

// ---- The connection's thread

void UsbipConnection::Run() {
  absl::Status served;
  while (served.ok()) served = Serve();
  if (ErrorReason(served) == "USBIP_MALFORMED") spdlog::error("{}", MessageOf(served));
  shutdown(socket_, SHUT_RDWR);
  MutexLock lock(&mutex_);
  over_ = true;
  ended_ = served;
  changed_.SignalAll();
}

absl::Status UsbipConnection::Serve() {
  UsbipHeader header;
  RETURN_IF_ERROR(ReadAll(socket_, header));
  ASSIGN_OR_RETURN(const UsbipCommand command, ParseUsbipCommand(header));
  if (command.kind == UsbipCommand::Kind::kSubmit) return Submit(command);
  Unlink(command);
  return absl::OkStatus();
}

absl::Status UsbipConnection::Submit(const UsbipCommand& command) {
  std::vector<uint8_t> data(command.in ? 0 : command.length);
  RETURN_IF_ERROR(ReadAll(socket_, data));
  if (command.endpoint != 0) {
    MutexLock lock(&mutex_);
    if (command.in && command.endpoint == bulk_in_) {
      waiting_.push_back({command.seqnum, command.length});
      changed_.SignalAll();
    } else {
      Write(UsbipSubmitAnswer(command.seqnum, -EPIPE, 0));
    }
    return absl::OkStatus();
  }
  const std::optional<std::vector<uint8_t>> answer = function_.Control(command.setup, data);
  MutexLock lock(&mutex_);
  if (!answer) {
    Write(UsbipSubmitAnswer(command.seqnum, -EPIPE, 0));
  } else if (command.in) {
    const size_t length = std::min<size_t>(answer->size(), command.length);
    Write(UsbipSubmitAnswer(command.seqnum, 0, static_cast<uint32_t>(length)),
          std::span(*answer).first(length));
  } else {
    Write(UsbipSubmitAnswer(command.seqnum, 0, command.length));
  }
  return absl::OkStatus();
}

void UsbipConnection::Unlink(const UsbipCommand& command) {
  MutexLock lock(&mutex_);
  const size_t removed = std::erase_if(
      waiting_, [&](const Request& request) { return request.seqnum == command.unlinked; });
  // 0: it had been answered already.
  Write(UsbipUnlinkAnswer(command.seqnum, removed > 0 ? -ECONNRESET : 0));
  changed_.SignalAll();
}

void UsbipConnection::Write(const UsbipHeader& header, std::span<const uint8_t> data) {
  for (std::span<const uint8_t> part : {std::span<const uint8_t>(header), data}) {
    while (!part.empty()) {
      const ssize_t count = send(socket_, part.data(), part.size(), MSG_NOSIGNAL);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return;
      part = part.subspan(static_cast<size_t>(count));
    }
  }
}

}  // namespace lightstage::sim
