// The device's end of USB/IP: what the kernel's vhci-hcd (or whoever else is the host) asks of one USB device over a stream socket, and the
// answers. Big-endian headers of 48 bytes, as in the kernel's Documentation/usb/usbip_protocol.rst. Control transfers, and bulk
// transfers of one IN endpoint; no isochronous ones.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"

namespace lightstage::sim {

// The eight bytes that begin a control transfer.
struct UsbSetup {
  uint8_t request_type = 0, request = 0;
  uint16_t value = 0, index = 0, length = 0;
  bool operator==(const UsbSetup&) const = default;
};

constexpr size_t kUsbipHeaderBytes = 48;
using UsbipHeader = std::array<uint8_t, kUsbipHeaderBytes>;

// What the host asks for.
struct UsbipCommand {
  enum class Kind : uint32_t { kSubmit = 1, kUnlink = 2 };
  Kind kind = Kind::kSubmit;
  uint32_t seqnum = 0;
  bool in = false;       // of a submission, as what follows
  uint8_t endpoint = 0;  // without its direction
  uint32_t length =
      0;           // of the host's buffer; that many bytes follow the header of an OUT transfer
  UsbSetup setup;  // of endpoint 0
  uint32_t unlinked = 0;  // of an unlinking: the submission's seqnum
  bool operator==(const UsbipCommand&) const = default;
};

// INVALID_ARGUMENT / USBIP_MALFORMED, naming the field.
absl::StatusOr<UsbipCommand> ParseUsbipCommand(const UsbipHeader& header);

// Answers. `status`: 0 or minus an errno; `actual` bytes follow if the transfer was IN.
UsbipHeader UsbipSubmitAnswer(uint32_t seqnum, int status, uint32_t actual);
UsbipHeader UsbipUnlinkAnswer(uint32_t seqnum, int status);

// What is at the end of the wire.
class UsbFunction {
 public:
  virtual ~UsbFunction() = default;
  // `data`: what an OUT transfer brings. What the device answers, for an IN transfer at most setup.length bytes of it; nothing: it stalls.
  virtual std::optional<std::vector<uint8_t>> Control(const UsbSetup& setup,
                                                      std::span<const uint8_t> data) = 0;
};

class UsbipConnection {
 public:
  // Serves `function`, which outlives it, on a connected stream socket, which it closes. `bulk_in`: number of the IN endpoint.
  UsbipConnection(int socket, UsbFunction& function, uint8_t bulk_in);
  ~UsbipConnection();  // the host sees the device unplugged
  UsbipConnection(const UsbipConnection&) = delete;
  UsbipConnection& operator=(const UsbipConnection&) = delete;

  // ---- Any thread. `cancelled` is called with a lock held: it must not call back; what makes it true calls Wake().

  // Sends one bulk transfer as packets: into the host's requests, as they come, until a short one or `most` bytes have ended it. False if
  // it was cancelled or the connection has ended.
  bool Send(std::span<const uint8_t> transfer, size_t most, absl::FunctionRef<bool()> cancelled);
  // Waits until the host has so many requests waiting for bytes; false as above.
  bool AwaitRequests(size_t count, absl::FunctionRef<bool()> cancelled);
  size_t requests() const;
  void Wake();
  // Every request that waits for bytes fails with `error` (an errno), as when the wire is disturbed.
  void FailRequests(int error);
  // OK while it lasts; then why it ended.
  absl::Status status() const;

 private:
  struct Request {
    uint32_t seqnum = 0;
    uint32_t length = 0;
  };

  void Run();
  // One command; an error ends the connection.
  absl::Status Serve();
  absl::Status Submit(const UsbipCommand& command);
  void Unlink(const UsbipCommand& command);
  bool Ready(size_t count, absl::FunctionRef<bool()> cancelled)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Answers go out whole and in the order in which requests are taken off the list: the host must not hear of one that it has been told is
  // unlinked. A host that is gone is noticed by who reads.
  void Write(const UsbipHeader& header, std::span<const uint8_t> data = {})
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const int socket_;
  UsbFunction& function_;
  const uint8_t bulk_in_;
  mutable Mutex mutex_;
  CondVar changed_;
  std::deque<Request> waiting_ ABSL_GUARDED_BY(mutex_);
  bool over_ ABSL_GUARDED_BY(mutex_) = false;
  absl::Status ended_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace lightstage::sim
