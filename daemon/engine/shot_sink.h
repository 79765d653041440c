// Where the engine puts what it captured: develop and store stand behind it.
#pragma once

#include <chrono>
#include <functional>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "dataset/shot.h"
#include "drivers/api/camera.h"

namespace lightstage {

// One captured shot before developing. `frames` and `exposures` have one entry per exposure of the bracket, in its order.
struct RawShot {
  Shot shot;
  Pose reported_pose;
  TimePoint lit_at{};  // when the light had confirmed
  std::vector<Frame> frames;
  std::vector<ExposureRecord> exposures;
  int attempt = 1;
  WallTime captured_at{};
};

// What became of a shot: its durable journal record, or why it could not be stored.
struct ShotOutcome {
  uint64_t shot_id = 0;
  absl::StatusOr<ShotRecord> record{absl::UnknownError("unset")};
};

class ShotSink {
 public:
  using OutcomeFn = std::function<void(ShotOutcome)>;

  virtual ~ShotSink() = default;

  // Takes the shot; waits while the queue is full, and calls `stalled` once if that takes longer than `patience` of real time.
  // Exactly one outcome follows, on any thread, when its record is durable or has failed. After a failure the sink stays usable.
  virtual void Put(RawShot shot, std::chrono::nanoseconds patience,
                   absl::FunctionRef<void()> stalled) = 0;

  // Returns when every shot put so far has had its outcome.
  virtual void Drain() = 0;
};

inline void PutPatiently(ShotSink& sink, RawShot shot) {
  sink.Put(std::move(shot), std::chrono::nanoseconds::max(), [] {});
}

}  // namespace lightstage
