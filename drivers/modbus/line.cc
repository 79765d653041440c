#include "drivers/modbus/line.h"

#include <modbus/modbus.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

const char* FunctionName(int function) {
  switch (function) {
    case 1:
      return "read coils";
    case 3:
      return "read holding registers";
    case 4:
      return "read input registers";
    case 5:
      return "write coil";
    case 6:
      return "write register";
    case 15:
      return "write coils";
    case 16:
      return "write registers";
    default:
      return "unknown";
  }
}

// Modbus application protocol V1.1b3, chapter 7.
const char* ExceptionName(int code) {
  switch (code) {
    case 1:
      return "ILLEGAL FUNCTION: the device does not have this function";
    case 2:
      return "ILLEGAL DATA ADDRESS: the device does not have all of these addresses";
    case 3:
      return "ILLEGAL DATA VALUE: the device does not take this value or this many";
    case 4:
      return "SERVER DEVICE FAILURE: the device could not do it";
    case 5:
      return "ACKNOWLEDGE: the device takes longer for it";
    case 6:
      return "SERVER DEVICE BUSY: the device is busy with something else";
    case 7:
      return "NEGATIVE ACKNOWLEDGE: the device cannot do it";
    case 8:
      return "MEMORY PARITY ERROR: the device's memory is damaged";
    case 10:
      return "GATEWAY PATH UNAVAILABLE: the gateway is overloaded or not set up for this unit";
    case 11:
      return "GATEWAY TARGET DEVICE FAILED TO RESPOND: behind the gateway this unit does not "
             "answer";
    default:
      return "a code that the standard does not know";
  }
}

void SetTimeouts(modbus_t* context, const LineOptions& options) {
  // For the whole answer, which then may come in pieces: with a limit between two bytes only, a device that dribbles would hold up whatever
  // comes next. On a serial line the longest frame takes its time on top.
  constexpr int kLongestFrame = 256, kBits = 11;
  Duration whole = options.response_timeout;
  if (!options.tcp())
    whole += FromSeconds(static_cast<double>(kLongestFrame * kBits) / options.baud);
  const auto timeout =
      static_cast<uint32_t>(std::chrono::duration_cast<microseconds>(whole).count());
  modbus_set_response_timeout(context, timeout / 1000000, timeout % 1000000);
  modbus_set_byte_timeout(context, 0, 0);  // none
}

ErrorMetadata MetadataOf(const Request& request, const LineOptions& line) {
  return {{"device", request.device},
          {"line", line.Name()},
          {"unit", absl::StrCat(request.unit)},
          {"function", absl::StrCat(request.function)},
          {"address", absl::StrCat(request.address)}};
}

absl::Status Lost(const std::string& device, const LineOptions& line, std::string_view why) {
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
               absl::StrCat(device, ": ", line.Name(), ": ", why),
               {{"device", device}, {"line", line.Name()}});
}

}  // namespace

std::string LineOptions::Name() const {
  return tcp() ? absl::StrCat(host, ":", port) : serial_port;
}

Duration FrameGap(int baud) {
  return std::max<Duration>(microseconds(1750), FromSeconds(3.5 * 11 / std::max(baud, 1)));
}

std::string Describe(const Request& request) {
  const char* what = request.function == 1 || request.function == 5 || request.function == 15
                         ? "coil"
                         : "register";
  std::string range = request.count == 1
                          ? absl::StrFormat("%s 0x%04X", what, request.address)
                          : absl::StrFormat("%ss 0x%04X to 0x%04X", what, request.address,
                                            request.address + request.count - 1);
  return absl::StrFormat("function %d (%s), %s of unit %d", request.function,
                         FunctionName(request.function), range, request.unit);
}

Outcome OutcomeOf(int error) {
  switch (error) {
    case ETIMEDOUT:
    case EAGAIN:
    case EMBXGPATH:
    case EMBXGTAR:
      return Outcome::kSilent;
    case EMBBADCRC:
    case EMBBADDATA:   // wrong length, or on TCP another transaction's
    case EMBBADEXC:    // an exception of another function
    case EMBUNKEXC:    // of an unknown code
    case EMBBADSLAVE:  // another unit's
      return Outcome::kGarbled;
    case EMBMDATA:
    case EINVAL:
      return Outcome::kWrong;
    default:
      if (error > MODBUS_ENOBASE && error < MODBUS_ENOBASE + MODBUS_EXCEPTION_MAX) {
        return Outcome::kException;
      }
      return Outcome::kLost;
  }
}

absl::Status RequestError(int error, const Request& request, const LineOptions& line) {
  const std::string where = absl::StrCat(request.device, ": ", line.Name(), ": ");
  ErrorMetadata metadata = MetadataOf(request, line);
  switch (OutcomeOf(error)) {
    case Outcome::kSilent: {
      std::string why =
          error == EMBXGPATH || error == EMBXGTAR
              ? absl::StrCat("exception ", error - MODBUS_ENOBASE, ", ",
                             ExceptionName(error - MODBUS_ENOBASE))
              : absl::StrCat(
                    "no answer within ",
                    std::chrono::duration_cast<milliseconds>(line.response_timeout).count(), " ms");
      return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                   absl::StrCat(where, why, " to ", Describe(request)), metadata);
    }
    case Outcome::kGarbled:
      return Error(
          absl::StatusCode::kDataLoss, "MODBUS_GARBLED",
          absl::StrCat(where, "the answer to ", Describe(request), " was garbled (",
                       modbus_strerror(error), ") ", line.retries + 1, " times",
                       line.tcp()
                           ? ""
                           : "; see to baud rate, parity, termination and two devices of one "
                             "unit number"),
          metadata);
    case Outcome::kException:
      metadata.emplace_back("exception", absl::StrCat(error - MODBUS_ENOBASE));
      return Error(
          absl::StatusCode::kFailedPrecondition, "MODBUS_EXCEPTION",
          absl::StrCat(where, "exception ", error - MODBUS_ENOBASE, ", ",
                       ExceptionName(error - MODBUS_ENOBASE), "; asked was ", Describe(request)),
          metadata);
    case Outcome::kLost:
      return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                   absl::StrCat(where, "the connection is lost (", std::strerror(error), ") at ",
                                Describe(request)),
                   metadata);
    case Outcome::kWrong:
      break;
  }
  return Error(
      absl::StatusCode::kInternal, "MODBUS_REQUEST",
      absl::StrCat(where, "cannot be asked: ", Describe(request), ": ", modbus_strerror(error)),
      metadata);
}

absl::StatusOr<std::shared_ptr<Line>> Line::Get(const LineOptions& options) {
  // A connection of its own for every device: what one of them loses does not concern the others.
  if (options.tcp()) return std::shared_ptr<Line>(new Line(options));
  static Mutex mutex;
  static auto* const lines = new std::map<std::string, std::weak_ptr<Line>>();
  MutexLock lock(&mutex);
  std::weak_ptr<Line>& known = (*lines)[options.serial_port];
  std::shared_ptr<Line> line = known.lock();
  if (line == nullptr) {
    line = std::shared_ptr<Line>(new Line(options));
    known = line;
  } else if (line->options() != options) {
    return Error(absl::StatusCode::kFailedPrecondition, "SERIAL_PORT_SHARED",
                 absl::StrCat(options.serial_port,
                              " is in use by another device of this rig with other settings; all "
                              "devices on one line need the same"),
                 {{"line", options.serial_port}});
  }
  return line;
}

Line::~Line() {
  MutexLock lock(&mutex_);
  CloseLocked();
}

absl::Status Line::Open(const std::string& device, uint64_t* session) {
  MutexLock lock(&mutex_);
  if (context_ == nullptr) {
    RETURN_IF_ERROR(OpenLocked(device));
    ++session_;
  }
  *session = session_;
  return absl::OkStatus();
}

absl::Status Line::OpenLocked(const std::string& device) {
  modbus_t* context = options_.tcp() ? modbus_new_tcp_pi(options_.host.c_str(),
                                                         std::to_string(options_.port).c_str())
                                     : modbus_new_rtu(options_.serial_port.c_str(), options_.baud,
                                                      options_.parity, 8, options_.stop_bits);
  if (context == nullptr) {
    return Error(absl::StatusCode::kInternal, "MODBUS_REQUEST",
                 absl::StrCat(device, ": ", options_.Name(), ": ", modbus_strerror(errno)),
                 {{"device", device}, {"line", options_.Name()}});
  }
  // MODBUS_ERROR_RECOVERY_LINK could loop for ever; what is to be done after an error is decided here.
  modbus_set_error_recovery(context, MODBUS_ERROR_RECOVERY_NONE);
  SetTimeouts(context, options_);
  errno = 0;
  if (modbus_connect(context) != 0) {
    const int error = errno;
    modbus_free(context);
    return Lost(device, options_,
                absl::StrCat("cannot be opened: ",
                             error == ETIMEDOUT ? "nobody answers" : modbus_strerror(error)));
  }
  // Nobody else is to talk in between.
  if (!options_.tcp()) ioctl(modbus_get_socket(context), TIOCEXCL);
  context_ = context;
  reply_due_ = false;
  return absl::OkStatus();
}

void Line::CloseLocked() {
  if (context_ == nullptr) return;
  if (!options_.tcp()) ioctl(modbus_get_socket(context_), TIOCNXCL);
  modbus_close(context_);
  modbus_free(context_);
  context_ = nullptr;
}

void Line::DiscardUntil(Clock& clock, TimePoint until) {
  while (clock.Now() < until) {
    SleepFor(clock, std::min<Duration>(until - clock.Now(), milliseconds(10)));
    modbus_flush(context_);
  }
}

absl::Status Line::Do(const Request& request, uint64_t session, Clock& clock,
                      absl::FunctionRef<int(modbus_t*)> call) {
  MutexLock lock(&mutex_);
  if (context_ == nullptr || session != session_) {
    return Lost(request.device, options_, "the connection was lost before");
  }
  const Duration gap = options_.tcp()                          ? Duration::zero()
                       : options_.frame_gap > Duration::zero() ? options_.frame_gap
                                                               : FrameGap(options_.baud);
  int error = 0;
  for (int attempt = 0; attempt <= options_.retries; ++attempt) {
    if (reply_due_) {
      if (options_.tcp()) {
        CloseLocked();
        RETURN_IF_ERROR(OpenLocked(request.device));
      } else {
        DiscardUntil(clock, quiet_at_);
        reply_due_ = false;
      }
    }
    if (const Duration early = last_frame_ + gap - clock.Now(); early > Duration::zero()) {
      SleepFor(clock, early);
    }
    modbus_flush(context_);
    modbus_set_slave(context_, request.unit);
    errno = 0;
    const int done = call(context_);
    error = errno;
    last_frame_ = clock.Now();
    if (done >= 0) return absl::OkStatus();
    switch (OutcomeOf(error)) {
      case Outcome::kGarbled:
        // What is left of it, or the right one behind it, may still come.
        reply_due_ = true;
        quiet_at_ = last_frame_ + std::min<Duration>(options_.response_timeout, milliseconds(50));
        continue;
      case Outcome::kSilent:
        reply_due_ = error == ETIMEDOUT || error == EAGAIN;
        quiet_at_ = last_frame_ + options_.response_timeout;
        return RequestError(error, request, options_);
      case Outcome::kLost:
        CloseLocked();
        return RequestError(error, request, options_);
      case Outcome::kException:
      case Outcome::kWrong:
        return RequestError(error, request, options_);
    }
  }
  return RequestError(error, request, options_);
}

}  // namespace lightstage
