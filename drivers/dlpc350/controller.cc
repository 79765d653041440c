#include "drivers/dlpc350/controller.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage::dlpc350 {
namespace {

using Steady = std::chrono::steady_clock;

std::string Hex(std::span<const uint8_t> bytes) {
  std::string hex;
  for (uint8_t byte : bytes) absl::StrAppendFormat(&hex, "%s%02x", hex.empty() ? "" : " ", byte);
  return hex;
}

absl::Status Fault(const Command& command, std::string_view what) {
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
               absl::StrFormat("command %02X %02X (%s): %s", command.cmd2, command.cmd3,
                               AbslView(command.name), AbslView(what)),
               {{"command", absl::StrFormat("%02X%02X", command.cmd2, command.cmd3)}});
}

}  // namespace

absl::StatusOr<std::vector<uint8_t>> Controller::Ask(const Command& command,
                                                     const std::vector<Report>& message,
                                                     bool read) {
  // What comes late from a command that was given up is not an answer to this one.
  while (true) {
    ASSIGN_OR_RETURN(std::vector<uint8_t> late, port_->Read(Duration::zero()));
    if (late.empty()) break;
  }
  for (const Report& report : message) RETURN_IF_ERROR(port_->Write(report));
  const Steady::time_point give_up = Steady::now() + kPatience;
  auto next = [&]() -> absl::StatusOr<std::vector<uint8_t>> {
    ASSIGN_OR_RETURN(std::vector<uint8_t> report,
                     port_->Read(std::max(give_up - Steady::now(), Steady::duration::zero())));
    if (report.empty()) {
      return Error(
          absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
          absl::StrFormat("command %02X %02X (%s) was not answered within %g s", command.cmd2,
                          command.cmd3, AbslView(command.name), Seconds(kPatience)),
          {{"command", absl::StrFormat("%02X%02X", command.cmd2, command.cmd3)}});
    }
    return report;
  };
  while (true) {
    ASSIGN_OR_RETURN(std::vector<uint8_t> reply, next());
    absl::StatusOr<ReplyHead> head = ParseReplyHead(reply);
    if (!head.ok()) return Fault(command, MessageOf(head.status()));
    for (size_t i = 1; i < head->reports; ++i) {
      ASSIGN_OR_RETURN(std::vector<uint8_t> more, next());
      if (more.size() != kReportSize) {
        return Fault(command,
                     absl::StrCat("a report of ", more.size(), " bytes instead of ", kReportSize));
      }
      reply.insert(reply.end(), more.begin(), more.end());
    }
    if (head->sequence != message.front()[1]) continue;  // to a command that was given up
    if (head->nack) return Fault(command, "refused (nack)");
    if (head->read != read)
      return Fault(command, "answered as if it were the other of read and write");
    absl::StatusOr<std::vector<uint8_t>> data = ParseReply(reply);
    if (!data.ok()) return Fault(command, MessageOf(data.status()));
    return data;
  }
}

absl::Status Controller::Write(const Command& command, std::span<const uint8_t> data) {
  return Ask(command, EncodeWrite(command, ++sequence_, data), false).status();
}

absl::StatusOr<std::vector<uint8_t>> Controller::Read(const Command& command, size_t least) {
  ASSIGN_OR_RETURN(std::vector<uint8_t> data,
                   Ask(command, {EncodeRead(command, ++sequence_)}, true));
  if (data.size() >= least) return data;
  return Fault(command, absl::StrCat("answered with ", data.size(), " bytes instead of ", least));
}

absl::Status Controller::Set(const Command& command, std::span<const uint8_t> data) {
  RETURN_IF_ERROR(Write(command, data));
  const Steady::time_point give_up = Steady::now() + (command.slow ? kSlow : Duration::zero());
  while (true) {
    ASSIGN_OR_RETURN(std::vector<uint8_t> is, Read(command, data.size()));
    if (std::equal(data.begin(), data.end(), is.begin())) return absl::OkStatus();
    if (Steady::now() >= give_up) {
      return Fault(command, absl::StrCat("is ", Hex(std::span(is).first(data.size())),
                                         " after it was set to ", Hex(data)));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

absl::StatusOr<StatusBits> Controller::ReadStatus() {
  StatusBits status;
  ASSIGN_OR_RETURN(std::vector<uint8_t> hardware, Read(kHardwareStatus, 1));
  ASSIGN_OR_RETURN(std::vector<uint8_t> system, Read(kSystemStatus, 1));
  ASSIGN_OR_RETURN(std::vector<uint8_t> main, Read(kMainStatus, 1));
  status.hardware = hardware[0];
  status.system = system[0];
  status.main = main[0];
  return status;
}

absl::Status Controller::SetMailbox(uint8_t mailbox, std::span<const uint8_t> data) {
  RETURN_IF_ERROR(Write(kMailbox, std::array<uint8_t, 1>{mailbox}));
  absl::Status set = [&]() -> absl::Status {
    RETURN_IF_ERROR(Write(kMailboxAddress, std::array<uint8_t, 1>{0}));
    RETURN_IF_ERROR(Write(kMailboxData, data));
    RETURN_IF_ERROR(Write(kMailboxAddress, std::array<uint8_t, 1>{0}));
    ASSIGN_OR_RETURN(std::vector<uint8_t> is, Read(kMailboxData, data.size()));
    if (std::equal(data.begin(), data.end(), is.begin())) return absl::OkStatus();
    return Fault(kMailboxData,
                 absl::StrCat("mailbox ", static_cast<int>(mailbox), " holds ",
                              Hex(std::span(is).first(data.size())), " instead of ", Hex(data)));
  }();
  // Whatever happened, it is not left open.
  absl::Status closed = Write(kMailbox, std::array<uint8_t, 1>{0});
  return set.ok() ? closed : set;
}

absl::Status Controller::SetSequence(uint8_t image, const LutEntry& entry) {
  RETURN_IF_ERROR(SetMailbox(1, std::array<uint8_t, 1>{image}));
  RETURN_IF_ERROR(SetMailbox(2, EncodeLutEntry(entry)));
  // One step, again and again, trigger out 2 with each, one image; all counts are less one.
  RETURN_IF_ERROR(Set(kLutConfig, {0, 1, 0, 0}));
  RETURN_IF_ERROR(Write(kValidate, std::array<uint8_t, 1>{0}));
  const Steady::time_point give_up = Steady::now() + 2 * kPatience;
  while (true) {
    ASSIGN_OR_RETURN(std::vector<uint8_t> answer, Read(kValidate, 1));
    if (!(answer[0] & kValidationBusy)) {
      const std::string wrong = DescribeValidation(answer[0]);
      return wrong.empty() ? absl::OkStatus() : Fault(kValidate, wrong);
    }
    if (Steady::now() > give_up) {
      return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
                   absl::StrCat("the ", kValidate.name, " was not done within ",
                                Seconds(2 * kPatience), " s"));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

}  // namespace lightstage::dlpc350
