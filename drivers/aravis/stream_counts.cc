#include "drivers/aravis/stream_counts.h"

#include "absl/strings/str_format.h"

namespace lightstage {

std::string Text(const StreamCounts& counts) {
  return absl::StrFormat(
      "%d frames complete, %d failed, %d without a buffer; packets: %d asked for again, %d resent, "
      "%d missing",
      counts.completed, counts.failed, counts.underruns, counts.requested, counts.resent,
      counts.missing);
}

std::optional<std::string> StreamCountsLog::Look(const StreamCounts& counts, TimePoint now) {
  StreamCounts good = said_;
  good.completed = counts.completed;
  if (counts == good) return std::nullopt;
  if (last_ && now - *last_ < kPause) return std::nullopt;
  said_ = counts;
  last_ = now;
  return Text(counts);
}

}  // namespace lightstage
