// A connection over which Modbus is spoken: TCP to one host, or a serial line (RTU), which all devices of a rig that are on it share.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/base/thread_annotations.h"
#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/mutex.h"

typedef struct _modbus modbus_t;

namespace lightstage {

struct LineOptions {
  // TCP, if not empty: an address or a name.
  std::string host;
  int port = 502;
  // Else a serial port; always 8 data bits.
  std::string serial_port;
  int baud = 115200;
  char parity = 'N';  // N, E or O
  int stop_bits = 1;
  Duration frame_gap{};  // silence before every request; 0: 3.5 characters, as the standard has it

  Duration response_timeout = std::chrono::milliseconds(200);
  int retries = 2;  // of requests whose reply arrived garbled

  bool tcp() const { return !host.empty(); }
  std::string Name() const;  // "192.168.7.5:502", "/dev/ttyUSB0"
  bool operator==(const LineOptions&) const = default;
};

// The silence that ends a frame on a serial line: 3.5 characters of 11 bits, never less than 1.75 ms (MODBUS over Serial Line V1.02, 2.5.1.1).
Duration FrameGap(int baud);

// What a request is about, for messages.
struct Request {
  std::string device;  // its name in the rig file
  int unit = 1;
  int function = 3;
  int address = 0, count = 1;
};

// "function 3 (read holding registers), registers 0x00CC to 0x00CD of unit 1"
std::string Describe(const Request& request);

// What became of a request that libmodbus gave up with `error` (errno).
enum class Outcome { kGarbled, kSilent, kLost, kException, kWrong };
Outcome OutcomeOf(int error);
// The error for it. DATA_LOSS / MODBUS_GARBLED, DEADLINE_EXCEEDED / DEVICE_SILENT, UNAVAILABLE / DEVICE_LOST,
// FAILED_PRECONDITION / MODBUS_EXCEPTION with the exception's name; INTERNAL / MODBUS_REQUEST is our own fault.
absl::Status RequestError(int error, const Request& request, const LineOptions& line);

// Thread-safe: one request at a time. Its errors name the request.
class Line {
 public:
  // The line of these options; serial lines are shared with everybody who has it. FAILED_PRECONDITION / SERIAL_PORT_SHARED if it is in use
  // with other settings.
  static absl::StatusOr<std::shared_ptr<Line>> Get(const LineOptions& options);
  ~Line();
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  const LineOptions& options() const { return options_; }

  // Opens it unless it is open. `session` counts the openings: a request of an earlier session is DEVICE_LOST, for what was on the line may
  // have lost its state with it. UNAVAILABLE / DEVICE_LOST within the response timeout if it cannot be opened.
  absl::Status Open(const std::string& device, uint64_t* session);

  // Sends one request by `call`, a function of libmodbus that returns −1 and errno. A garbled reply is asked for again. After silence, a
  // reply that comes late cannot be taken for a later request's: TCP gets a new connection, a serial line is heard out.
  absl::Status Do(const Request& request, uint64_t session, Clock& clock,
                  absl::FunctionRef<int(modbus_t*)> call);

 private:
  explicit Line(LineOptions options) : options_(std::move(options)) {}
  absl::Status OpenLocked(const std::string& device) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void CloseLocked() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void DiscardUntil(Clock& clock, TimePoint until) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const LineOptions options_;
  Mutex mutex_;
  modbus_t* context_ ABSL_GUARDED_BY(mutex_) = nullptr;
  uint64_t session_ ABSL_GUARDED_BY(mutex_) = 0;
  bool reply_due_ ABSL_GUARDED_BY(mutex_) = false;  // one that was not waited for any longer
  TimePoint quiet_at_ ABSL_GUARDED_BY(mutex_){};    // when it counts as lost
  TimePoint last_frame_ ABSL_GUARDED_BY(mutex_){};
};

}  // namespace lightstage
