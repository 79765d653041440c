#include "daemon/rpc/names.h"

#include <algorithm>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "base/status.h"

namespace lightstage::rpc {

std::string RunName(const std::string& id) { return "runs/" + id; }

absl::StatusOr<std::string> RunId(const std::string& name) {
  std::string id = name.rfind("runs/", 0) == 0 ? name.substr(5) : "";
  bool plain = !id.empty() && std::all_of(id.begin(), id.end(), [](unsigned char c) {
    return std::isalnum(c) || c == '-' || c == '_';
  });
  if (plain) return id;
  return Error(absl::StatusCode::kInvalidArgument, "RESOURCE_NAME",
               absl::StrFormat("'%s' is not the name of a run; runs/ID is", name),
               {{"name", name}});
}

absl::StatusOr<Page> PageOf(uint64_t size, int32_t page_size, int32_t default_size,
                            int32_t max_size, const std::string& token) {
  if (page_size < 0) {
    return Error(absl::StatusCode::kInvalidArgument, "PAGE_SIZE",
                 absl::StrFormat("page_size is %d; it must be in [0, %d]", page_size, max_size),
                 {{"page_size", absl::StrCat(page_size)}});
  }
  Page page;
  if (!token.empty() && (!absl::SimpleAtoi(token, &page.first) || page.first > size)) {
    return Error(absl::StatusCode::kInvalidArgument, "PAGE_TOKEN",
                 absl::StrFormat("page_token '%s' is not one that this list gave", token),
                 {{"page_token", token}});
  }
  uint64_t count = page_size == 0 ? default_size : std::min(page_size, max_size);
  page.last = std::min(size, page.first + count);
  if (page.last < size) page.next_token = absl::StrCat(page.last);
  return page;
}

absl::StatusOr<Duration> WatchInterval(double seconds) {
  if (seconds == 0) seconds = 0.1;
  if (seconds >= 0.02 && seconds <= 60) return FromSeconds(seconds);
  return Error(absl::StatusCode::kInvalidArgument, "WATCH_INTERVAL",
               absl::StrFormat("min_interval_seconds is %g; it must be in [0.02, 60], or 0 for 0.1",
                               seconds),
               {{"min_interval_seconds", absl::StrCat(seconds)}});
}

void SleepUnless(Duration interval, absl::FunctionRef<bool()> ended) {
  const absl::Time end = absl::Now() + absl::FromChrono(interval);
  for (absl::Duration left; (left = end - absl::Now()) > absl::ZeroDuration() && !ended();)
    absl::SleepFor(std::min(left, absl::Milliseconds(100)));
}

}  // namespace lightstage::rpc
