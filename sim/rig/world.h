// The world that the simulated devices share: what every lamp, the projector and the axes did and when, and what a camera saw of
// it. All times are on the rig's clock. Thread-safe; nothing here waits for the clock.
//
// Light and motion are kept as functions of time (sim/rig/timeline.h), so that an exposure integrates the light that was really
// on, at the pose that the rig really had, between its start and its end. History older than kHistory is forgotten.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "drivers/api/axis.h"
#include "drivers/api/camera.h"
#include "optics/image.h"
#include "optics/pattern.h"
#include "optics/rig_geometry.h"
#include "sim/render/transport.h"
#include "sim/rig/options.h"
#include "sim/rig/sensor.h"
#include "sim/rig/timeline.h"

namespace lightstage::sim {

// What Faults counts.
enum class Operation { kTrigger, kMove, kSet, kShow };

enum class AxisRole { kTurntable = 0, kTilt = 1 };

// What a projector shows: a pattern, exactly; or what the codes of its own pixels say, one byte each, value = code / 255, top row first.
using PixelCodes = std::shared_ptr<const std::vector<uint8_t>>;
using Projection = std::variant<Pattern, PixelCodes>;

// One contribution to an exposure: a light that shone for a while at one pose.
struct LightTerm {
  Pose pose;
  bool moving = false;  // one step of a motion: not worth caching
  int lamp = -1;        // index on the brace, or −1: `projection`
  Projection projection;
  double level_seconds = 0;  // ∫ level dt, while any row was open
  std::vector<float> rows;   // the same by row, if they are open at different times; else empty
};

class World {
 public:
  static constexpr Duration kHistory = std::chrono::seconds(60);
  // A moving axis is integrated in steps of at most this.
  static constexpr Angle kMotionStep = Degrees(0.25);

  // `clock` must outlive the world. NOT_FOUND / SCENE if there is no scene of that name; the scene's own errors; INSIDE_OBJECT if
  // the camera stands in an object; INVALID_ARGUMENT / LAMP_UNKNOWN if a lamp is to be dim that does not exist.
  static absl::StatusOr<std::shared_ptr<World>> Create(const WorldOptions& options,
                                                       const RigGeometry& geometry, Clock& clock);

  Clock& clock() const { return *clock_; }
  const RigGeometry& geometry() const { return transport_.geometry(); }
  const SensorOptions& sensor() const { return options_.sensor; }

  // Replaces the faults on purpose; counts begin again at 1.
  void SetFaults(const Faults& faults);
  // Counts one more operation; true if it must never be answered.
  bool FaultDue(Operation operation);
  // Counts one more frame; true if it must lose data.
  bool FrameLost();

  // ---- What devices do to the world. Times do not decrease from call to call of one device.

  // Every lamp goes from what it is at `from` to its new level, linearly: brighter within `rise`, darker within `fall`.
  void RampLamps(TimePoint from, Duration rise, Duration fall, absl::Span<const float> levels);
  // The projector's image fades from what it is at `from` into `projection` at `to`, linearly. Pixels are kept until they are history.
  void RampProjection(TimePoint from, TimePoint to, const Projection& projection);
  // Its lamp goes out: not even black shines.
  void EndProjector(TimePoint from);
  // Replaces what the axis does from the motion's start on.
  void SetMotion(AxisRole axis, const Motion& motion);

  // ---- What there is at a moment, up to now.

  AxisState AxisAt(AxisRole role, TimePoint t) const;  // `homed` is for the device to say
  Pose PoseAt(TimePoint t) const;
  std::vector<float> LampLevels(TimePoint t) const;
  Projection Shown(TimePoint t) const;  // the brightest while one fades into another

  // ---- What a camera sees of it. These compute for milliseconds; call them where that is allowed.

  // RESOURCE_EXHAUSTED / MEMORY with the figure, if the paths of a picture of this size would take too much. For cameras, when they
  // open.
  absl::Status CheckFilm(FilmSize size) const;

  // How much later than the first row the last one begins and ends (rolling shutter).
  Duration RowLag(int height) const { return options_.sensor.line_time * (height - 1); }

  // ∫ radiance dt of every pixel, through the camera's lens, from `start` to `end`, and of the rows below so much later
  // (SensorOptions::line_time); end + RowLag ≤ now. 3 channels, J/(m²·sr). OUT_OF_RANGE / HISTORY if `start` is forgotten;
  // INSIDE_OBJECT if what shines stands in an object.
  absl::StatusOr<Image> Integrate(TimePoint start, TimePoint end, FilmSize size);

  // The same through the sensor. The noise is a function of the seed and of the light terms and exposure only – not of time or of
  // earlier frames –, so that a shot taken again after a crash has the very same pixels (and so that frames of one condition
  // cannot be averaged to get rid of it). `bits`: the chip's depth. Sequence and device timestamp are for the camera to fill.
  absl::StatusOr<Frame> Expose(TimePoint start, TimePoint end, PixelFormat format, FilmSize size,
                               int bits, double gain_db = 0);

  // What a camera that ends an exposure right now, in its last row, delivers. For peers that serve the picture on a
  // wire of their own.
  absl::StatusOr<Frame> ExposeNow(Duration exposure, PixelFormat format, FilmSize size, int bits);

  // Traces what the lights of this moment need at the pose of this moment, so that a frame taken now will be quick.
  void Prefetch(FilmSize size);

 private:
  World(const WorldOptions& options, const RigGeometry& geometry, Clock& clock, Scene scene);

  // Of rows that begin at `start` + row · line time.
  std::vector<LightTerm> TermsLocked(TimePoint start, TimePoint end, int rows) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<std::vector<LightTerm>> Terms(TimePoint start, TimePoint end, int rows) const;
  double LampIntegralLocked(int lamp, TimePoint a, TimePoint b) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Pose PoseLocked(TimePoint t) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // INSIDE_OBJECT if a light stands in an object.
  absl::StatusOr<Image> Render(const std::vector<LightTerm>& terms, Duration exposure,
                               FilmSize size);
  void ForgetLocked(TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const WorldOptions options_;
  Clock* const clock_;
  Transport transport_;

  mutable Mutex mutex_;
  Faults faults_ ABSL_GUARDED_BY(mutex_);
  std::array<int, 4> counts_ ABSL_GUARDED_BY(mutex_){};  // by Operation
  int frames_ ABSL_GUARDED_BY(mutex_) = 0;
  std::vector<LevelTimeline> lamps_ ABSL_GUARDED_BY(mutex_);
  std::map<Projection, LevelTimeline> projections_
      ABSL_GUARDED_BY(mutex_);  // share of each in the projector's light
  std::array<MotionTimeline, 2> axes_ ABSL_GUARDED_BY(mutex_);      // by AxisRole
  TimePoint forgotten_ ABSL_GUARDED_BY(mutex_) = TimePoint::min();  // history begins here
};

}  // namespace lightstage::sim
