#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "drivers/dmx/ftdi.h"
#include "drivers/dmx/pro_message.h"
#include "drivers/dmx/widget.h"

namespace lightstage::dmx {
namespace {

using std::chrono::milliseconds;

constexpr Duration kPatience = milliseconds(300);
constexpr Duration kSlice = milliseconds(50);  // of waiting for a reply

// A message of which only a part arrived, when the program before this one ended, would swallow the next ones. So many zeros fill up the longest
// and end it with what is no E7; between messages they are nothing.
constexpr std::array<uint8_t, kProMaxData + 5> kFlush{};

class ProWidget final : public DmxWidget {
 public:
  ProWidget(std::unique_ptr<UsbPort> port, Clock& clock)
      : clock_(clock), identity_(port->identity()), port_(std::move(port)) {}

  absl::Status Start() {
    // Between chip and widget bytes go in parallel: neither rate nor format to set.
    for (const UsbRequest& request :
         {FtdiResetRequest(FtdiReset::kAll), FtdiResetRequest(FtdiReset::kPurgeRx),
          FtdiResetRequest(FtdiReset::kPurgeTx), FtdiNoFlowControlRequest(),
          FtdiLatencyRequest(1)}) {
      RETURN_IF_ERROR(port_->Control(request, kPatience));
    }
    RETURN_IF_ERROR(NoPro(AskSerial()));
    return AskParameters();
  }

  std::string model() const override {
    return absl::StrFormat("DMX USB Pro (%s %s, serial number %s, firmware %d.%02d)",
                           identity_.manufacturer, identity_.product, serial_,
                           parameters_.firmware_major, parameters_.firmware_minor);
  }
  std::string serial() const override {
    return identity_.serial.empty() ? serial_ : identity_.serial;
  }

  absl::Status Show(std::span<const uint8_t> slots) override {
    return Guard([&]() -> absl::Status {
      RETURN_IF_ERROR(Send(EncodeProOutput(slots)));
      // It takes messages in order: the answer to a question says that the slots before it have arrived. Not label 10: that would end
      // the output.
      RETURN_IF_ERROR(AskParameters());
      SleepFor(clock_, ProTimeToLine(parameters_, slots.size()));
      return absl::OkStatus();
    });
  }

  absl::Status Check() override {
    return Guard([&] { return AskParameters(); });
  }

 private:
  // Gives the device back after an error.
  template <class Call>
  absl::Status Guard(Call call) {
    if (port_ == nullptr) return failure_;
    absl::Status status = call();
    if (!status.ok()) {
      failure_ = status;
      port_.reset();
    }
    return status;
  }

  absl::Status AskSerial() {
    RETURN_IF_ERROR(Send(kFlush));
    RETURN_IF_ERROR(Send(EncodeProGetSerial()));
    ASSIGN_OR_RETURN(ProMessage reply, Receive(kProGetSerial));
    const std::optional<std::string> serial = DecodeProSerial(reply.data);
    if (!serial.has_value()) return Odd(reply, "serial number");
    serial_ = *serial;
    return absl::OkStatus();
  }

  absl::Status AskParameters() {
    RETURN_IF_ERROR(Send(EncodeProGetParameters()));
    ASSIGN_OR_RETURN(ProMessage reply, Receive(kProGetParameters));
    const std::optional<ProParameters> parameters = DecodeProParameters(reply.data);
    if (!parameters.has_value()) return Odd(reply, "parameters");
    parameters_ = *parameters;
    return absl::OkStatus();
  }

  absl::Status Send(std::span<const uint8_t> message) {
    absl::StatusOr<size_t> taken = port_->BulkOut(message, kPatience);
    if (!taken.ok()) return Annotate(taken.status(), "sending a message");
    if (*taken == message.size()) return absl::OkStatus();
    return Error(
        absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
        absl::StrCat("the widget took ", *taken, " of a message's ", message.size(), " bytes"),
        {{"bytes", absl::StrCat(*taken)}, {"message_bytes", absl::StrCat(message.size())}});
  }

  // The next message with `label`; others, as of received DMX, are passed over.
  absl::StatusOr<ProMessage> Receive(uint8_t label) {
    const TimePoint deadline = clock_.Now() + kPatience;
    while (true) {
      while (std::optional<ProMessage> message = decoder_.Next()) {
        if (message->label == label) return *std::move(message);
      }
      const Duration left = deadline - clock_.Now();
      if (left <= Duration::zero()) {
        return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                     absl::StrCat("the widget did not answer a request with label ", label),
                     {{"label", absl::StrCat(label)}});
      }
      std::array<uint8_t, 8 * kFtdiPacket> bytes{};
      absl::StatusOr<size_t> count = port_->BulkIn(bytes, std::min(left, kSlice));
      if (!count.ok()) return Annotate(count.status(), "reply");
      decoder_.Feed(FtdiPayload(std::span(bytes).first(*count)));
      // The chip sends its status every millisecond, with or without a reply.
      if (*count <= 2) SleepFor(clock_, milliseconds(1));
    }
  }

  absl::Status NoPro(const absl::Status& status) const {
    if (ErrorReason(status) != "DEVICE_SILENT") return status;
    return Annotate(status,
                    absl::StrCat("the device at ", identity_.address, " (", identity_.product,
                                 ") is no DMX USB Pro, or does not answer"));
  }

  static absl::Status Odd(const ProMessage& reply, std::string_view what) {
    return Error(
        absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
        absl::StrCat("the widget's reply to a request for its ", what, " makes no sense (",
                     reply.data.size(), " bytes)"),
        {{"label", absl::StrCat(reply.label)}, {"bytes", absl::StrCat(reply.data.size())}});
  }

  Clock& clock_;
  const UsbIdentity identity_;
  std::unique_ptr<UsbPort> port_;  // none after `failure_`
  absl::Status failure_;
  ProDecoder decoder_;
  ProParameters parameters_;
  std::string serial_;  // as printed on the case
};

}  // namespace

absl::StatusOr<std::unique_ptr<DmxWidget>> StartProWidget(std::unique_ptr<UsbPort> port,
                                                          Clock& clock) {
  auto widget = std::make_unique<ProWidget>(std::move(port), clock);
  RETURN_IF_ERROR(widget->Start());
  return std::unique_ptr<DmxWidget>(std::move(widget));
}

}  // namespace lightstage::dmx
