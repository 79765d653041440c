#include "daemon/store/journal.h"

#include <zlib.h>

#include <optional>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

constexpr size_t kCrcDigits = 8;

std::string CrcHex(std::string_view bytes) {
  uLong crc = ::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  return absl::StrFormat("%08x", static_cast<uint32_t>(crc));
}

// The payload of a line without its end, if the line is good.
std::optional<std::string_view> Payload(std::string_view line) {
  if (line.size() < kCrcDigits + 2 || line[kCrcDigits] != ' ') return std::nullopt;
  std::string_view summed = line.substr(kCrcDigits + 1);
  if (CrcHex(summed) != line.substr(0, kCrcDigits)) return std::nullopt;
  size_t space = summed.find(' ');
  uint64_t length = 0;
  if (space == std::string_view::npos ||
      !absl::SimpleAtoi(AbslView(summed.substr(0, space)), &length) ||
      length != summed.size() - space - 1) {
    return std::nullopt;
  }
  return summed.substr(space + 1);
}

}  // namespace

std::string JournalLine(std::string_view payload) {
  std::string summed = absl::StrCat(payload.size(), " ", payload);
  return absl::StrCat(CrcHex(summed), " ", summed, "\n");
}

JournalScan ScanJournal(std::string_view text, std::string_view name,
                        absl::FunctionRef<absl::Status(std::string_view payload)> entry) {
  JournalScan scan;
  uint64_t number = 0;
  absl::Status
      bad;  // the first bad line since the last good one: damage only if a good one follows
  auto at = [&](uint64_t offset, std::string_view why) {
    return Error(absl::StatusCode::kDataLoss, "JOURNAL_CORRUPT",
                 absl::StrCat(name, ": line ", number, " at byte ", offset, ": ", why),
                 {{"file", std::string(name)},
                  {"line", absl::StrCat(number)},
                  {"offset", absl::StrCat(offset)}});
  };
  for (uint64_t offset = 0; offset < text.size();) {
    ++number;
    size_t end = text.find('\n', offset);
    bool whole = end != std::string_view::npos;
    std::string_view line = text.substr(offset, (whole ? end : text.size()) - offset);
    uint64_t next = whole ? end + 1 : text.size();
    std::optional<std::string_view> payload = whole ? Payload(line) : std::nullopt;
    if (!payload) {
      if (bad.ok()) bad = at(offset, "its checksum is wrong");
    } else {
      if (scan.damage.ok()) scan.damage = bad;
      absl::Status taken = entry(*payload);
      if (!taken.ok() && scan.damage.ok()) scan.damage = at(offset, std::string(taken.message()));
      bad = absl::OkStatus();
      scan.good_bytes = next;
    }
    offset = next;
  }
  scan.torn_bytes = text.size() - scan.good_bytes;
  return scan;
}

}  // namespace lightstage
