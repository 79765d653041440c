// A Modbus server: devices, by unit number, behind TCP on loopback or behind a pseudo-terminal as if on a serial line. What goes wrong on wires
// can be made to.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "sim/peers/modbus/frames.h"

namespace lightstage::sim {

// One unit. Called from the server's thread.
class ModbusDevice {
 public:
  virtual ~ModbusDevice() = default;
  // A read is answered with request.count values.
  virtual ModbusAnswer Handle(const ModbusRequest& request) = 0;
  // Every few milliseconds.
  virtual void Tick() {}
};

enum class WireFault {
  kNone,
  kSilence,      // no answer, and nothing is done
  kLostReply,    // it is done, but not answered
  kSilentWrite,  // as kSilence, of writes; reads are answered and do not count
  kLate,         // answered `parameter` ms late
  kException,    // answered with exception `parameter`
  kGarbage,      // a wrong CRC; on TCP another transaction's number
  kTruncated,    // the answer lacks its last bytes
  kOtherUnit,    // answered by the unit with the next number
  kDribble,      // answered byte by byte, `parameter` ms before each
};

class ModbusServer {
 public:
  using Devices = std::map<int, std::shared_ptr<ModbusDevice>>;  // shared with who looks at them

  // On 127.0.0.1; port 0: one that is free. UNAVAILABLE / PEER_NOT_STARTED.
  static absl::StatusOr<std::unique_ptr<ModbusServer>> StartTcp(Devices devices, int port = 0);
  // The terminal gets the name `link`, where nothing may be yet, or one in a new folder.
  static absl::StatusOr<std::unique_ptr<ModbusServer>> StartRtu(Devices devices,
                                                                std::string link = "");
  ~ModbusServer();
  ModbusServer(const ModbusServer&) = delete;
  ModbusServer& operator=(const ModbusServer&) = delete;

  // ---- Any thread.

  int port() const { return port_; }
  const std::string& serial_port() const {
    return link_;
  }  // stays the same from Unplug() to Plug()

  // For the next `requests` requests after `skip` others.
  void Inject(WireFault fault, int requests = 1, int parameter = 0, int skip = 0);
  int requests() const { return requests_; }  // so far

  // As pulling out the network cable's far end, or the converter: connections end, new ones are refused.
  void Unplug();
  absl::Status Plug();

 private:
  struct Connection {
    int fd = -1;
    std::vector<uint8_t> received;
    TimePoint last{};
  };

  explicit ModbusServer(Devices devices) : devices_(std::move(devices)) {}
  absl::Status Listen() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status OpenPty() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void CloseLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Start();
  void Run();
  void Poll();
  void Accept() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // False if the connection has ended.
  bool Receive(Connection& connection) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Answers the first whole request, if there is one.
  bool TakeTcp(Connection& connection) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool TakeRtu(Connection& connection) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Answer(int fd, int transaction, int unit, std::span<const uint8_t> pdu)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Send(int fd, std::span<const uint8_t> frame, Duration late)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Devices devices_;
  int port_ = 0;
  bool tcp_ = false;
  std::string directory_, link_;

  RealClock clock_;
  std::atomic<bool> quit_{false};
  std::atomic<int> requests_{0};
  Mutex mutex_;
  int listener_ ABSL_GUARDED_BY(mutex_) = -1;
  int far_end_ ABSL_GUARDED_BY(mutex_) = -1;  // keeps the terminal alive while nobody has it open
  std::vector<Connection> connections_ ABSL_GUARDED_BY(mutex_);  // of RTU: the terminal
  WireFault fault_ ABSL_GUARDED_BY(mutex_) = WireFault::kNone;
  int skip_ ABSL_GUARDED_BY(mutex_) = 0, times_ ABSL_GUARDED_BY(mutex_) = 0,
            parameter_ ABSL_GUARDED_BY(mutex_) = 0;
  std::thread thread_;
};

}  // namespace lightstage::sim
