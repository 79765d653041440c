#include "drivers/v4l2/free_running.h"

#include <algorithm>

namespace lightstage {
namespace {

bool Believed(const FrameStamp& frame) { return frame.stamp && *frame.stamp <= frame.dequeued; }

// Without the option, SOE is not believed: uvcvideo sets it and stamps a frame's first packet, which is sent after the exposure.
bool StampedAtStart(const FrameStamp& frame, const ExposureTiming& timing) {
  return Believed(frame) && frame.flagged_start_of_exposure && timing.stamps_at_exposure_start;
}

}  // namespace

TimePoint EarliestLight(const FrameStamp& frame, Duration exposure, const ExposureTiming& timing) {
  const TimePoint there = Believed(frame) ? *frame.stamp : frame.not_before;
  const Duration late = timing.latency.value_or(timing.interval);
  return StampedAtStart(frame, timing) ? there - late : there - exposure - late;
}

TimePoint LatestStart(const FrameStamp& frame, Duration exposure, const ExposureTiming& timing) {
  const TimePoint there = Believed(frame) ? *frame.stamp : frame.dequeued;
  return StampedAtStart(frame, timing) ? there : there - exposure;
}

TimePoint LikelyExposureEnd(const FrameStamp& frame, Duration exposure,
                            const ExposureTiming& timing) {
  const Duration late = timing.latency.value_or(Duration::zero());
  return std::min(LatestStart(frame, exposure, timing) - late + exposure, frame.dequeued);
}

FrameCounter::Step FrameCounter::Next(uint32_t raw) {
  Step step;
  if (last_) {
    const uint32_t ahead = raw - *last_;  // modulo 2^32
    step.backwards = ahead == 0 || ahead > UINT32_MAX / 2;
    if (!step.backwards) step.skipped = ahead - 1;
  }
  last_ = raw;
  sequence_ += 1 + uint64_t{step.skipped};
  step.sequence = sequence_;
  return step;
}

}  // namespace lightstage
