#include "sim/rig/world.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <new>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "sim/render/hash.h"
#include "sim/rig/lenses.h"
#include "sim/rig/world_scene.h"

namespace lightstage::sim {
namespace {

// No exposure is cut into more steps than this, however fast the motion.
constexpr double kMostSteps = 256;

// Of the sensor's fixed pattern, apart from its noise.
constexpr uint64_t kFixedPattern = 0x6670;

uint64_t Fold(uint64_t hash, const LightTerm& term) {
  for (double v :
       {WrapTurn(term.pose.azimuth).degrees(), term.pose.tilt.degrees(), term.level_seconds}) {
    hash = sim::Fold(hash, v);
  }
  if (const PixelCodes* codes = std::get_if<PixelCodes>(&term.projection)) {
    for (uint8_t code : **codes) hash = sim::Fold(hash, uint64_t{code});
    return hash;
  }
  const Pattern& p = std::get<Pattern>(term.projection);
  for (int v : {term.lamp, static_cast<int>(p.arrangement), static_cast<int>(p.profile), p.grid,
                p.influence, p.column, p.row}) {
    hash = sim::Fold(hash, static_cast<uint64_t>(v));
  }
  return hash;
}

bool IsBlack(const Projection& projection) {
  if (const Pattern* pattern = std::get_if<Pattern>(&projection)) {
    return pattern->arrangement == PatternArrangement::kBlack;
  }
  const std::vector<uint8_t>& codes = *std::get<PixelCodes>(projection);
  return std::all_of(codes.begin(), codes.end(), [](uint8_t code) { return code == 0; });
}

// The values of the projector's pixels.
Image ValuesOf(const Projection& projection, const ProjectorGeometry& projector) {
  if (const Pattern* pattern = std::get_if<Pattern>(&projection)) {
    return Rasterize(*pattern, projector.width, projector.height);
  }
  const std::vector<uint8_t>& codes = *std::get<PixelCodes>(projection);
  Image values(projector.width, projector.height, 1);
  std::transform(codes.begin(), codes.end(), values.pixels().begin(),
                 [](uint8_t code) { return static_cast<float>(code) / 255.0f; });
  return values;
}

}  // namespace

absl::StatusOr<std::shared_ptr<World>> World::Create(const WorldOptions& options,
                                                     const RigGeometry& geometry, Clock& clock) {
  const int lamps = static_cast<int>(geometry.brace.lamps.size());
  for (const auto& [lamp, share] : options.lamps.dim) {
    if (lamp < lamps) continue;
    return Error(absl::StatusCode::kInvalidArgument, "LAMP_UNKNOWN",
                 absl::StrCat("[[simulation.lamps.dim]] lamp ", lamp,
                              " does not exist: this rig has ", lamps, " lamps"),
                 {{"lamp", absl::StrCat(lamp)}});
  }
  ASSIGN_OR_RETURN(Scene scene, MakeWorldScene(options, geometry));
  return std::shared_ptr<World>(new World(options, geometry, clock, std::move(scene)));
}

World::World(const WorldOptions& options, const RigGeometry& geometry, Clock& clock, Scene scene)
    : options_(options),
      clock_(&clock),
      transport_(std::move(scene), geometry,
                 {.seed = options.seed,
                  .samples = options.samples,
                  .bounces = options.bounces,
                  .cache_bytes = options.cache_bytes,
                  .lamp_intensity_w_sr = options.lamps.intensity_w_sr,
                  .projector_intensity_w_sr = options.projector.intensity_w_sr,
                  .lens = LensOf(options.projector, geometry.projector),
                  .parts = options.parts}),
      faults_(options.faults),
      lamps_(geometry.brace.lamps.size()) {}

void World::SetFaults(const Faults& faults) {
  MutexLock lock(&mutex_);
  faults_ = faults;
  counts_ = {};
  frames_ = 0;
}

bool World::FaultDue(Operation operation) {
  MutexLock lock(&mutex_);
  const int count = ++counts_[static_cast<size_t>(operation)];
  switch (operation) {
    case Operation::kTrigger:
      return faults_.camera_silent_at_frame > 0 && count >= faults_.camera_silent_at_frame &&
             count < faults_.camera_silent_at_frame + faults_.camera_silent_frames;
    case Operation::kMove:
      return count == faults_.axis_stall_at_move;
    case Operation::kSet:
      return count == faults_.lamps_refuse_at_set;
    case Operation::kShow:
      return count == faults_.projector_refuse_at_show;
  }
  return false;
}

bool World::FrameLost() {
  MutexLock lock(&mutex_);
  ++frames_;
  return faults_.camera_incomplete_every > 0 && frames_ % faults_.camera_incomplete_every == 0;
}

// ---- What devices do

void World::RampLamps(TimePoint from, Duration rise, Duration fall,
                      absl::Span<const float> levels) {
  assert(levels.size() == geometry().brace.lamps.size());
  MutexLock lock(&mutex_);
  for (size_t i = 0; i < levels.size(); ++i) {
    lamps_[i].RampTo(from, from + (levels[i] > lamps_[i].At(from) ? rise : fall), levels[i]);
  }
  ForgetLocked(from);
}

void World::RampProjection(TimePoint from, TimePoint to, const Projection& projection) {
  const bool shines = options_.projector.black > 0 || !IsBlack(projection);
  MutexLock lock(&mutex_);
  for (auto& [other, share] : projections_) {
    if (other != projection) share.RampTo(from, to, 0);
  }
  if (shines) projections_[projection].RampTo(from, to, 1);
  // It may be told ahead of its time (the video chain's latency); what is still to be exposed is not older than the present.
  ForgetLocked(std::min(from, clock_->Now()));
}

void World::EndProjector(TimePoint from) {
  MutexLock lock(&mutex_);
  for (auto& [projection, share] : projections_) share.RampTo(from, from, 0);
  ForgetLocked(from);
}

void World::SetMotion(AxisRole axis, const Motion& motion) {
  MutexLock lock(&mutex_);
  axes_[static_cast<size_t>(axis)].Set(motion);
  ForgetLocked(motion.front().start);
}

void World::ForgetLocked(TimePoint now) {
  const TimePoint horizon = now - kHistory;
  if (horizon <= forgotten_) return;
  forgotten_ = horizon;
  for (LevelTimeline& lamp : lamps_) lamp.Forget(horizon);
  for (auto it = projections_.begin(); it != projections_.end();) {
    it->second.Forget(horizon);
    it = it->second.IsIdle() ? projections_.erase(it) : std::next(it);
  }
  for (MotionTimeline& axis : axes_) axis.Forget(horizon);
}

// ---- What there is at a moment

AxisState World::AxisAt(AxisRole role, TimePoint t) const {
  MutexLock lock(&mutex_);
  const MotionTimeline& axis = axes_[static_cast<size_t>(role)];
  return {.position = Degrees(axis.Position(t)),
          .velocity_dps = axis.Velocity(t),
          .moving = axis.Moving(t)};
}

Pose World::PoseAt(TimePoint t) const {
  MutexLock lock(&mutex_);
  return PoseLocked(t);
}

Pose World::PoseLocked(TimePoint t) const {
  return {Degrees(axes_[0].Position(t)), Degrees(axes_[1].Position(t))};
}

std::vector<float> World::LampLevels(TimePoint t) const {
  MutexLock lock(&mutex_);
  std::vector<float> levels;
  for (const LevelTimeline& lamp : lamps_) levels.push_back(static_cast<float>(lamp.At(t)));
  return levels;
}

Projection World::Shown(TimePoint t) const {
  MutexLock lock(&mutex_);
  Projection shown;
  double most = 0;
  for (const auto& [projection, share] : projections_) {
    if (double level = share.At(t); level > most) most = level, shown = projection;
  }
  return shown;
}

// ---- What a camera sees

double World::LampIntegralLocked(int lamp, TimePoint a, TimePoint b) const {
  const LampOptions& o = options_.lamps;
  double sum =
      o.pwm_hz > 0 ? lamps_[lamp].PulsedIntegral(a, b, o.pwm_hz) : lamps_[lamp].Integral(a, b);
  if (sum == 0) return 0;
  if (auto dim = o.dim.find(lamp); dim != o.dim.end()) sum *= dim->second;
  if (o.drift > 0) {
    const double phase = UnitFloat(sim::Fold(options_.seed, static_cast<uint64_t>(lamp))) +
                         Seconds((a + (b - a) / 2).time_since_epoch()) / o.drift_period_s;
    sum *= 1 + o.drift * std::sin(2 * std::numbers::pi * phase);
  }
  return sum;
}

std::vector<LightTerm> World::TermsLocked(TimePoint start, TimePoint end, int rows) const {
  const Duration lag = RowLag(rows), line = options_.sensor.line_time;
  std::vector<TimePoint> cuts = {start, end + lag};
  for (const MotionTimeline& axis : axes_) axis.AppendBreaks(start, end + lag, &cuts);
  std::sort(cuts.begin(), cuts.end());

  std::vector<LightTerm> terms;
  // Adds a light that shone between a and b; integral(from, to) says how much.
  auto add = [&](LightTerm term, TimePoint a, TimePoint b, auto integral) {
    term.level_seconds = integral(a, b);
    if (term.level_seconds <= 0) return;
    for (int row = 0; lag > Duration::zero() && row < rows; ++row) {
      const TimePoint from = std::max(a, start + row * line), to = std::min(b, end + row * line);
      term.rows.push_back(from < to ? static_cast<float>(integral(from, to)) : 0.0f);
    }
    terms.push_back(std::move(term));
  };
  for (size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double way =
        std::max(axes_[0].Way(cuts[i], cuts[i + 1]), axes_[1].Way(cuts[i], cuts[i + 1]));
    const auto steps =
        static_cast<int64_t>(std::clamp(std::ceil(way / kMotionStep.degrees()), 1.0, kMostSteps));
    const Duration length = cuts[i + 1] - cuts[i];
    for (int64_t s = 0; s < steps; ++s) {
      const TimePoint a = cuts[i] + length * s / steps, b = cuts[i] + length * (s + 1) / steps;
      LightTerm term{.pose = PoseLocked(a + (b - a) / 2), .moving = way > 0};
      for (int lamp = 0; lamp < static_cast<int>(lamps_.size()); ++lamp) {
        term.lamp = lamp;
        add(term, a, b, [&](TimePoint from, TimePoint to) {
          mutex_.AssertHeld();
          return LampIntegralLocked(lamp, from, to);
        });
      }
      term.lamp = -1;
      for (const auto& [projection, share] : projections_) {
        term.projection = projection;
        add(term, a, b, [&timeline = share](TimePoint from, TimePoint to) {
          return timeline.Integral(from, to);
        });
      }
    }
  }
  return terms;
}

absl::StatusOr<Image> World::Render(const std::vector<LightTerm>& terms, Duration exposure,
                                    FilmSize size) try {
  Image sum(size.width, size.height, 3);
  // `image`, of a light of this colour, times what is open of it per row.
  auto add = [&](const Image& image, std::span<const float> rows,
                 const std::array<double, 3>& color) {
    for (int y = 0; y < size.height; ++y) {
      const std::span<const float> in = image.row(y);
      const std::span<float> out = sum.row(y);
      float scale[3];
      for (int c = 0; c < 3; ++c) scale[c] = rows[y] * static_cast<float>(color[c]);
      for (size_t i = 0; i < out.size(); i += 3) {
        for (size_t c = 0; c < 3; ++c) out[i + c] += scale[c] * in[i + c];
      }
    }
  };
  for (const LightTerm& term : terms) {
    RETURN_IF_ERROR(transport_.CheckOutside(term.pose, term.lamp));
    const Keep keep = term.moving ? Keep::kNo : Keep::kYes;
    std::vector<float> rows = term.rows;
    if (rows.empty()) rows.assign(size.height, static_cast<float>(term.level_seconds));
    if (term.lamp < 0) {
      const Image shown =
          Emitted(ValuesOf(term.projection, geometry().projector), options_.projector);
      transport_.Projector(size, term.pose, keep)->Add(shown, rows, &sum);
    } else {
      add(*transport_.Lamp(size, term.pose, term.lamp, keep), rows, options_.lamps.color);
    }
  }
  if (options_.ambient_w_m2_sr > 0) {
    const auto light = static_cast<float>(options_.ambient_w_m2_sr * Seconds(exposure));
    add(*transport_.Ambient(size), std::vector<float>(size.height, light), {1, 1, 1});
  }
  PassLens(options_.lens, &sum);
  return sum;
} catch (const std::bad_alloc&) {
  return Error(absl::StatusCode::kResourceExhausted, "MEMORY",
               absl::StrFormat("there is no memory left for the light of a simulated camera of "
                               "%d x %d pixels: make the sensor, samples, bounces or [simulation] "
                               "cache_mb smaller",
                               size.width, size.height));
}

absl::StatusOr<std::vector<LightTerm>> World::Terms(TimePoint start, TimePoint end,
                                                    int rows) const {
  MutexLock lock(&mutex_);
  if (start < forgotten_) {
    return Error(absl::StatusCode::kOutOfRange, "HISTORY",
                 absl::StrCat("an exposure that began ", Seconds(clock_->Now() - start),
                              " s ago reaches back beyond the ", Seconds(kHistory),
                              " s that the simulation remembers"),
                 {{"began_s_ago", absl::StrCat(Seconds(clock_->Now() - start))},
                  {"history_s", absl::StrCat(Seconds(kHistory))}});
  }
  return TermsLocked(start, end, rows);
}

absl::Status World::CheckFilm(FilmSize size) const {
  const size_t bytes = transport_.EstimatePathBytes(size);
  if (bytes <= options_.paths_bytes) return absl::OkStatus();
  return Error(absl::StatusCode::kResourceExhausted, "MEMORY",
               absl::StrFormat("a simulated camera of %d x %d pixels takes about %d MB for its "
                               "light paths; [simulation] paths_mb allows "
                               "%d MB: make the sensor, samples or bounces smaller",
                               size.width, size.height, bytes >> 20, options_.paths_bytes >> 20),
               {{"needed_mb", absl::StrCat(bytes >> 20)},
                {"allowed_mb", absl::StrCat(options_.paths_bytes >> 20)}});
}

absl::StatusOr<Image> World::Integrate(TimePoint start, TimePoint end, FilmSize size) {
  ASSIGN_OR_RETURN(std::vector<LightTerm> terms, Terms(start, end, size.height));
  return Render(terms, end - start, size);
}

absl::StatusOr<Frame> World::Expose(TimePoint start, TimePoint end, PixelFormat format,
                                    FilmSize size, int bits, double gain_db) {
  ASSIGN_OR_RETURN(std::vector<LightTerm> terms, Terms(start, end, size.height));
  uint64_t noise_key = sim::Fold(options_.seed, static_cast<uint64_t>((end - start).count()));
  for (const LightTerm& term : terms) noise_key = Fold(noise_key, term);
  ASSIGN_OR_RETURN(const Image light, Render(terms, end - start, size));
  Frame frame;
  frame.format = format;
  frame.width = size.width;
  frame.height = size.height;
  frame.significant_bits = SignificantBits(format, bits);
  frame.data = ReadSensor(light, options_.sensor, format, bits, gain_db, noise_key,
                          sim::Fold(options_.seed, kFixedPattern));
  frame.exposure = end - start;
  frame.gain_db = gain_db;
  frame.exposure_start = start;
  frame.exposure_end = end + RowLag(size.height);
  return frame;
}

absl::StatusOr<Frame> World::ExposeNow(Duration exposure, PixelFormat format, FilmSize size,
                                       int bits) {
  const TimePoint end = clock_->Now() - RowLag(size.height);
  return Expose(end - exposure, end, format, size, bits);
}

void World::Prefetch(FilmSize size) {
  std::vector<LightTerm> terms;
  {
    MutexLock lock(&mutex_);
    const TimePoint now = clock_->Now();
    terms = TermsLocked(now - std::chrono::microseconds(1), now, 1);
  }
  try {
    for (const LightTerm& term : terms) {
      if (term.moving) continue;
      if (term.lamp < 0) {
        transport_.Projector(size, term.pose, Keep::kYes);
      } else {
        transport_.Lamp(size, term.pose, term.lamp, Keep::kYes);
      }
    }
  } catch (const std::bad_alloc&) {
    // The exposure that needs it says so.
  }
}

}  // namespace lightstage::sim
