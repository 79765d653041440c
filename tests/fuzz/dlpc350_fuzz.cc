// Replies of the DLPC350 and what is in them.
#include <algorithm>

#include "base/status.h"
#include "drivers/dlpc350/codec.h"
#include "tests/fuzz/fuzz.h"

namespace lightstage::dlpc350 {
namespace {

using fuzz::Input;
using Bytes = std::vector<uint8_t>;

void Reply(std::span<const uint8_t> reports) {
  const std::span<const uint8_t> first = reports.first(std::min(reports.size(), kReportSize));
  const absl::StatusOr<ReplyHead> head = ParseReplyHead(first);
  const absl::StatusOr<Bytes> data = ParseReply(reports);
  if (!head.ok()) {
    HOLDS(!data.ok() && data.status().code() == absl::StatusCode::kDataLoss);
    return;
  }
  HOLDS(head->length <= kMaxReply);
  HOLDS(head->reports * kReportSize >= 4 + head->length);
  HOLDS((head->reports - 1) * kReportSize < 4 + head->length);
  // With all the reports that it says it takes, it is a reply.
  HOLDS(data.ok() || reports.size() < head->reports * kReportSize);
  if (!data.ok()) return;
  HOLDS(data->size() == head->length && head->length + 4 <= reports.size());
  HOLDS(std::ranges::equal(*data, reports.subspan(4, head->length)));
}

// A message of the driver's own, with command and data where a reply has data alone.
void Message(Input in) {
  const uint8_t sequence = in.Byte();
  const Bytes sent = in.Take(kMaxReply - 2);
  const std::vector<Report> reports = EncodeWrite(kMailboxData, sequence, sent);
  Bytes bytes;
  for (const Report& report : reports) bytes.insert(bytes.end(), report.begin(), report.end());
  const absl::StatusOr<ReplyHead> head = ParseReplyHead(reports.front());
  HOLDS(head.ok() && head->reports == reports.size() && head->sequence == sequence);
  HOLDS(!head->nack && !head->read);
  const absl::StatusOr<Bytes> data = ParseReply(bytes);
  HOLDS(data.ok() && data->size() == sent.size() + 2);
  HOLDS((*data)[0] == kMailboxData.cmd3 && (*data)[1] == kMailboxData.cmd2);
  HOLDS(std::equal(sent.begin(), sent.end(), data->begin() + 2));
}

void Contents(Input in) {
  const absl::StatusOr<std::string> version = ParseVersion(in.rest());
  HOLDS(version.ok() == (in.size() >= 4));
  HOLDS(!version.ok() || std::ranges::count(*version, '.') == 2);

  const std::array<uint8_t, 3> bytes = {in.Byte(), in.Byte(), in.Byte()};
  const LutEntry entry = DecodeLutEntry(bytes);
  HOLDS(DecodeLutEntry(EncodeLutEntry(entry)) == entry);
  const std::array<uint8_t, 3> again = EncodeLutEntry(entry);
  // Reserved bits are not kept.
  HOLDS(again[0] == bytes[0] && again[1] == (bytes[1] & 0x7F) && again[2] == (bytes[2] & 0x0F));

  const StatusBits status{in.Byte(), in.Byte(), in.Byte()};
  const bool sound = (status.hardware & 0xCD) == 0x01 && (status.system & 0x01) != 0;
  HOLDS(DescribeErrors(status).empty() == sound);
  const uint8_t validation = in.Byte();
  HOLDS(DescribeValidation(validation).empty() == ((validation & 0x1F) == 0));
}

}  // namespace
}  // namespace lightstage::dlpc350

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lightstage::fuzz::Input in(data, size);
  switch (in.Choice(3)) {
    case 0:
      lightstage::dlpc350::Reply(in.rest());
      break;
    case 1:
      lightstage::dlpc350::Message(in);
      break;
    default:
      lightstage::dlpc350::Contents(in);
  }
  return 0;
}
