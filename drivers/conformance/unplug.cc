#include "drivers/conformance/unplug.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <climits>
#include <cstdio>
#include <filesystem>
#include <iterator>

#include "base/status.h"

namespace lightstage {
namespace {

constexpr int kTimes = 3;
constexpr Duration kAtMost = std::chrono::seconds(1);
// For peers that end connections on threads of their own.
constexpr Duration kPatience = std::chrono::seconds(20);

std::ptrdiff_t OpenDescriptors() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"),
                       std::filesystem::directory_iterator());
}

}  // namespace

void CheckUnplugging(Clock& clock, const char* device, const Unplugging& unplugging) {
  // How often it took to bring it back into use: what stands still for a while on a busy machine is lost once more.
  const auto recover = [&](absl::Status status) {
    const TimePoint give_up = clock.Now() + kPatience;
    int tries = 0;
    while (!status.ok() && clock.Now() < give_up) {
      ++tries;
      status = unplugging.recover();
      if (status.ok()) status = unplugging.use();
    }
    EXPECT_TRUE(status.ok()) << status;
    return status.ok() ? tries : INT_MAX;
  };
  recover(unplugging.use());
  const std::ptrdiff_t descriptors = OpenDescriptors();
  Duration best = Duration::max();
  int least_tries = INT_MAX;
  for (int i = 0; i < kTimes; ++i) {
    unplugging.plug(false);
    const TimePoint begin = clock.Now();
    const absl::Status lost = unplugging.use();
    const Duration taken = clock.Now() - begin;
    EXPECT_LE(taken, kPatience) << "it hangs";
    best = std::min(best, taken);
    EXPECT_TRUE(ErrorReason(lost) == "DEVICE_LOST" || ErrorReason(lost) == "DEVICE_SILENT") << lost;
    EXPECT_NE(lost.message().find(device), std::string::npos) << "names no device: " << lost;
    unplugging.plug(true);
    const int tries = recover(lost);
    ASSERT_LT(tries, INT_MAX);
    least_tries = std::min(least_tries, tries);
  }
  EXPECT_EQ(least_tries, 1) << "to recover once is enough";
  std::printf("measured: %s unplugged: told after %.0f ms (best of %d)\n", device,
              Seconds(best) * 1e3, kTimes);
  EXPECT_LE(best, kAtMost);
  const TimePoint give_up = clock.Now() + kPatience;
  while (OpenDescriptors() > descriptors && clock.Now() < give_up) {
    SleepFor(clock, std::chrono::milliseconds(20));
  }
  EXPECT_LE(OpenDescriptors(), descriptors) << "descriptors that stay open";
}

}  // namespace lightstage
