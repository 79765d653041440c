// Which frames of a camera that runs freely belong to a shot: those, and only those, that gathered no light before it was triggered.
// And its frame numbers. Pure.
#pragma once

#include <cstdint>
#include <optional>

#include "base/clock.h"

namespace lightstage {

// When a frame was there.
struct FrameStamp {
  // The kernel's time stamp, if it is of CLOCK_MONOTONIC – which is the rig's clock, see base/clock.cc.
  std::optional<TimePoint> stamp;
  bool flagged_start_of_exposure = false;  // V4L2_BUF_FLAG_TSTAMP_SRC_SOE
  TimePoint not_before{};                  // when it was last seen not to be there yet
  TimePoint dequeued{};
};

struct ExposureTiming {
  // From the end of the first row's exposure to the stamp. Nothing: at most one frame interval of readout, and one frame more is passed
  // over for what lies between the sensor and the stamp.
  std::optional<Duration> latency;
  bool stamps_at_exposure_start = false;  // believe stamps that are flagged so
  Duration interval{};                    // between frames
};

// No row of the frame gathered light before this. A stamp of the future is not believed: then the frame came after `not_before`, which is
// all that is known.
TimePoint EarliestLight(const FrameStamp& frame, Duration exposure, const ExposureTiming& timing);

// When its first row began to gather light if the latency were 0. A frame whose stamp is not believed may have waited, but for no longer than
// until it was dequeued.
TimePoint LatestStart(const FrameStamp& frame, Duration exposure, const ExposureTiming& timing);

// As well as it can be told, when the exposure ended; not after the frame was dequeued.
TimePoint LikelyExposureEnd(const FrameStamp& frame, Duration exposure,
                            const ExposureTiming& timing);

// The frames of one shot, in their order.
class FrameChoice {
 public:
  FrameChoice() = default;
  // Only frames without light from before `lit` count; the first `skip` of them are passed over.
  FrameChoice(TimePoint lit, int skip) : lit_(lit), skip_(skip) {}
  TimePoint lit() const { return lit_; }
  bool Counts(TimePoint earliest_light) {
    if (earliest_light < lit_) return false;
    return skip_-- <= 0;
  }

 private:
  TimePoint lit_{};
  int skip_ = 0;
};

// The kernel's 32-bit frame numbers, which begin anew with every stream and may wrap, as one count that only rises.
class FrameCounter {
 public:
  struct Step {
    uint64_t sequence = 0;
    uint32_t skipped = 0;    // frames between the last one and this
    bool backwards = false;  // it has the last one's number or an earlier one's
  };
  void Restart() { last_.reset(); }
  Step Next(uint32_t raw);

 private:
  std::optional<uint32_t> last_;
  uint64_t sequence_ = 0;
};

}  // namespace lightstage
