#include "drivers/dlpc350/codec.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "base/status.h"

namespace lightstage::dlpc350 {
namespace {

constexpr size_t kHeaderSize = 4;
constexpr uint8_t kFlagRead = 0x80, kFlagReply = 0x40, kFlagNack = 0x20;
constexpr double kDelayStepUs = 0.1072;

std::vector<Report> Encode(uint8_t flags, const Command& command, uint8_t sequence,
                           std::span<const uint8_t> data) {
  const size_t length = data.size() + 2;
  std::vector<uint8_t> bytes = {
      flags,        sequence,    static_cast<uint8_t>(length), static_cast<uint8_t>(length >> 8),
      command.cmd3, command.cmd2};
  bytes.insert(bytes.end(), data.begin(), data.end());
  std::vector<Report> reports((bytes.size() + kReportSize - 1) / kReportSize);
  for (size_t i = 0; i < bytes.size(); ++i) reports[i / kReportSize][i % kReportSize] = bytes[i];
  return reports;
}

std::string Joined(const std::vector<std::string>& all) { return absl::StrJoin(all, ", "); }

}  // namespace

std::vector<Report> EncodeWrite(const Command& command, uint8_t sequence,
                                std::span<const uint8_t> data) {
  return Encode(kFlagReply, command, sequence, data);
}

Report EncodeRead(const Command& command, uint8_t sequence) {
  return Encode(kFlagRead | kFlagReply, command, sequence, {}).front();
}

absl::StatusOr<ReplyHead> ParseReplyHead(std::span<const uint8_t> report) {
  if (report.size() != kReportSize) {
    return Error(absl::StatusCode::kDataLoss, "REPORT_SHORT",
                 absl::StrCat("a report of ", report.size(), " bytes instead of ", kReportSize));
  }
  ReplyHead head;
  head.read = report[0] & kFlagRead;
  head.nack = report[0] & kFlagNack;
  head.sequence = report[1];
  head.length = report[2] | static_cast<size_t>(report[3]) << 8;
  if (head.length > kMaxReply) {
    return Error(absl::StatusCode::kDataLoss, "REPLY_LENGTH",
                 absl::StrCat("a reply of ", head.length, " bytes; there are at most ", kMaxReply));
  }
  head.reports = (kHeaderSize + head.length + kReportSize - 1) / kReportSize;
  return head;
}

absl::StatusOr<std::vector<uint8_t>> ParseReply(std::span<const uint8_t> reports) {
  ASSIGN_OR_RETURN(ReplyHead head,
                   ParseReplyHead(reports.first(std::min(reports.size(), kReportSize))));
  if (reports.size() < kHeaderSize + head.length) {
    return Error(
        absl::StatusCode::kDataLoss, "REPLY_LENGTH",
        absl::StrCat("a reply of ", head.length, " bytes in reports of only ", reports.size()));
  }
  std::span<const uint8_t> data = reports.subspan(kHeaderSize, head.length);
  return std::vector<uint8_t>(data.begin(), data.end());
}

std::string DescribeErrors(const StatusBits& status) {
  std::vector<std::string> errors;
  if (!(status.hardware & 0x01)) errors.push_back("its initialisation failed");
  if (status.hardware & 0x04) errors.push_back("mirror reset error");
  if (status.hardware & 0x08) errors.push_back("forced swap of the frame buffer");
  if (status.hardware & 0x40) errors.push_back("the sequencer aborted");
  if (status.hardware & 0x80) errors.push_back("sequencer error");
  if (!(status.system & 0x01)) errors.push_back("its memory test failed");
  return Joined(errors);
}

std::string DescribeValidation(uint8_t bits) {
  std::vector<std::string> wrong;
  if (bits & 0x01) wrong.push_back("exposure or period is not possible at this depth");
  if (bits & 0x02) wrong.push_back("pattern number is not possible at this depth");
  if (bits & 0x04) wrong.push_back("trigger out 1 overlaps a black pattern");
  if (bits & 0x08) wrong.push_back("black is missing before an external trigger");
  if (bits & 0x10) wrong.push_back("period is less than 230 us longer than exposure");
  return Joined(wrong);
}

absl::StatusOr<std::string> ParseVersion(std::span<const uint8_t> data) {
  if (data.size() < 4) {
    return Error(absl::StatusCode::kDataLoss, "REPLY_LENGTH",
                 absl::StrCat("a firmware version of ", data.size(), " bytes"));
  }
  return absl::StrCat(static_cast<int>(data[3]), ".", static_cast<int>(data[2]), ".",
                      data[0] | data[1] << 8);
}

std::array<uint8_t, 3> EncodeLutEntry(const LutEntry& entry) {
  return {static_cast<uint8_t>((entry.trigger & 3) | (entry.number & 0x3f) << 2),
          static_cast<uint8_t>((entry.depth & 0xf) | (entry.leds & 7) << 4),
          static_cast<uint8_t>(entry.invert << 0 | entry.black << 1 | entry.swap << 2 |
                               entry.trigger_out_before << 3)};
}

LutEntry DecodeLutEntry(std::span<const uint8_t, 3> bytes) {
  LutEntry entry;
  entry.trigger = bytes[0] & 3;
  entry.number = bytes[0] >> 2;
  entry.depth = bytes[1] & 0xf;
  entry.leds = bytes[1] >> 4 & 7;
  entry.invert = bytes[2] & 1;
  entry.black = bytes[2] & 2;
  entry.swap = bytes[2] & 4;
  entry.trigger_out_before = bytes[2] & 8;
  return entry;
}

std::array<uint8_t, 8> EncodeExposure(uint32_t exposure_us, uint32_t period_us) {
  std::array<uint8_t, 8> bytes;
  for (int i = 0; i < 4; ++i) {
    bytes[i] = static_cast<uint8_t>(exposure_us >> 8 * i);
    bytes[4 + i] = static_cast<uint8_t>(period_us >> 8 * i);
  }
  return bytes;
}

uint8_t EncodeTriggerOutDelay(double delay_us) {
  return static_cast<uint8_t>(std::clamp(std::lround(0xBB + delay_us / kDelayStepUs), 0L, 0xD5L));
}

std::array<uint8_t, 4> EncodeTriggerInDelay(double delay_us) {
  const long steps = std::clamp(std::lround(delay_us / kDelayStepUs), 0L, 0x7FFFFL);
  return {static_cast<uint8_t>(steps), static_cast<uint8_t>(steps >> 8),
          static_cast<uint8_t>(steps >> 16), 0};
}

}  // namespace lightstage::dlpc350
