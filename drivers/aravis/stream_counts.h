// What a stream counted, and when it is worth a line in the log. Pure values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/clock.h"

namespace lightstage {

struct StreamCounts {
  uint64_t completed = 0, failed = 0, underruns = 0;  // frames; an underrun found no buffer
  // Packets, of GigE streams only.
  uint64_t missing = 0;    // did not come, not even when asked for again
  uint64_t requested = 0;  // asked for again
  uint64_t resent = 0;     // came when asked for again

  bool AnythingWrong() const { return failed + underruns + missing + requested + resent > 0; }
  bool operator==(const StreamCounts&) const = default;
};

// "12 frames complete, 1 failed, 0 without a buffer; packets: 3 asked for again, 2 resent, 1 missing".
std::string Text(const StreamCounts& counts);

// Says what a stream loses when it grows, and not more often than every 10 s, over all streams of a camera.
class StreamCountsLog {
 public:
  static constexpr Duration kPause = std::chrono::seconds(10);

  // A stream that counts from 0 on.
  void Restart() { said_ = {}; }
  // What to say now, if anything.
  std::optional<std::string> Look(const StreamCounts& counts, TimePoint now);

 private:
  StreamCounts said_;
  std::optional<TimePoint> last_;
};

}  // namespace lightstage
