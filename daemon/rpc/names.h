// What requests have in common: resource names, paging, watch intervals. Errors are INVALID_ARGUMENT naming field and value.
#pragma once

#include <cstdint>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "base/clock.h"

namespace lightstage::rpc {

std::string RunName(const std::string& id);  // "runs/{id}"
// The id. RESOURCE_NAME unless `name` is "runs/{id}".
absl::StatusOr<std::string> RunId(const std::string& name);

// Half-open range of a list of `size` elements. PAGE_SIZE, PAGE_TOKEN.
struct Page {
  uint64_t first = 0, last = 0;
  std::string next_token;  // empty on the last page
};
absl::StatusOr<Page> PageOf(uint64_t size, int32_t page_size, int32_t default_size,
                            int32_t max_size, const std::string& token);

// [0.02, 60] s, 0: 0.1 s. WATCH_INTERVAL.
absl::StatusOr<Duration> WatchInterval(double seconds);
// Sleeps in real time so long, or until `ended`, which is asked ten times a second.
void SleepUnless(Duration interval, absl::FunctionRef<bool()> ended);

}  // namespace lightstage::rpc
