#include "sim/rig/world.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "sim/render/hash.h"
#include "sim/scenes/scenes.h"

namespace lightstage::sim {
namespace {

// No exposure is cut into more steps than this, however fast the motion.
constexpr double kMostSteps = 256;

uint64_t Fold(uint64_t hash, const LightTerm& term) {
  for (double v :
       {WrapTurn(term.pose.azimuth).degrees(), term.pose.tilt.degrees(), term.level_seconds}) {
    hash = sim::Fold(hash, v);
  }
  const Pattern& p = term.pattern;
  for (int v : {term.lamp, static_cast<int>(p.arrangement), static_cast<int>(p.profile), p.grid,
                p.influence, p.column, p.row}) {
    hash = sim::Fold(hash, static_cast<uint64_t>(v));
  }
  return hash;
}

}  // namespace

absl::StatusOr<std::shared_ptr<World>> World::Create(const WorldOptions& options,
                                                     const RigGeometry& geometry, Clock& clock) {
  ASSIGN_OR_RETURN(SceneDescription description,
                   LoadScene(options.scene, options.scene_directory));
  ASSIGN_OR_RETURN(Scene scene, Scene::Build(std::move(description)));
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
                  .lamp_intensity_w_sr = options.lamp_intensity_w_sr,
                  .projector_intensity_w_sr = options.projector_intensity_w_sr}),
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

void World::RampLamps(TimePoint from, TimePoint to, absl::Span<const float> levels) {
  assert(levels.size() == geometry().brace.lamps.size());
  MutexLock lock(&mutex_);
  for (size_t i = 0; i < levels.size(); ++i) lamps_[i].RampTo(from, to, levels[i]);
  ForgetLocked(from);
}

void World::RampPattern(TimePoint from, TimePoint to, const Pattern& pattern) {
  MutexLock lock(&mutex_);
  for (auto& [other, share] : patterns_) {
    if (other != pattern) share.RampTo(from, to, 0);
  }
  if (pattern.arrangement != PatternArrangement::kBlack) patterns_[pattern].RampTo(from, to, 1);
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
  for (auto it = patterns_.begin(); it != patterns_.end();) {
    it->second.Forget(horizon);
    it = it->second.IsIdle() ? patterns_.erase(it) : std::next(it);
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

Pattern World::ShownPattern(TimePoint t) const {
  MutexLock lock(&mutex_);
  Pattern shown;
  double most = 0;
  for (const auto& [pattern, share] : patterns_) {
    if (double level = share.At(t); level > most) most = level, shown = pattern;
  }
  return shown;
}

// ---- What a camera sees

std::vector<LightTerm> World::TermsLocked(TimePoint start, TimePoint end) const {
  std::vector<TimePoint> cuts = {start, end};
  for (const MotionTimeline& axis : axes_) axis.AppendBreaks(start, end, &cuts);
  std::sort(cuts.begin(), cuts.end());

  std::vector<LightTerm> terms;
  for (size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double way =
        std::max(axes_[0].Way(cuts[i], cuts[i + 1]), axes_[1].Way(cuts[i], cuts[i + 1]));
    const auto steps =
        static_cast<int64_t>(std::clamp(std::ceil(way / kMotionStep.degrees()), 1.0, kMostSteps));
    const Duration length = cuts[i + 1] - cuts[i];
    for (int64_t s = 0; s < steps; ++s) {
      const TimePoint a = cuts[i] + length * s / steps, b = cuts[i] + length * (s + 1) / steps;
      LightTerm term{.pose = PoseLocked(a + (b - a) / 2), .moving = way > 0};
      for (size_t lamp = 0; lamp < lamps_.size(); ++lamp) {
        term.level_seconds = lamps_[lamp].Integral(a, b);
        term.lamp = static_cast<int>(lamp);
        if (term.level_seconds > 0) terms.push_back(term);
      }
      term.lamp = -1;
      for (const auto& [pattern, share] : patterns_) {
        term.level_seconds = share.Integral(a, b);
        term.pattern = pattern;
        if (term.level_seconds > 0) terms.push_back(term);
      }
    }
  }
  return terms;
}

Image World::Render(const std::vector<LightTerm>& terms, FilmSize size) {
  Image sum(size.width, size.height, 3);
  std::span<float> out = sum.pixels();
  for (const LightTerm& term : terms) {
    const Keep keep = term.moving ? Keep::kNo : Keep::kYes;
    const auto scale = static_cast<float>(term.level_seconds);
    if (term.lamp < 0) {
      const ProjectorGeometry& projector = geometry().projector;
      Image raster = Rasterize(term.pattern, projector.width, projector.height);
      transport_.Projector(size, term.pose, keep)->Add(raster, scale, &sum);
      continue;
    }
    std::shared_ptr<const Image> lamp = transport_.Lamp(size, term.pose, term.lamp, keep);
    std::span<const float> in = lamp->pixels();
    for (size_t i = 0; i < out.size(); ++i) out[i] += scale * in[i];
  }
  return sum;
}

absl::StatusOr<std::vector<LightTerm>> World::Terms(TimePoint start, TimePoint end) const {
  MutexLock lock(&mutex_);
  if (start < forgotten_) {
    return Error(absl::StatusCode::kOutOfRange, "HISTORY",
                 absl::StrCat("an exposure that began ", Seconds(end - start),
                              " s before its end reaches back beyond the ", Seconds(kHistory),
                              " s that the simulation remembers"),
                 {{"exposure_s", absl::StrCat(Seconds(end - start))},
                  {"history_s", absl::StrCat(Seconds(kHistory))}});
  }
  return TermsLocked(start, end);
}

absl::StatusOr<Image> World::Integrate(TimePoint start, TimePoint end, FilmSize size) {
  ASSIGN_OR_RETURN(std::vector<LightTerm> terms, Terms(start, end));
  return Render(terms, size);
}

absl::StatusOr<Frame> World::Expose(TimePoint start, TimePoint end, PixelFormat format,
                                    FilmSize size, int bits, double gain_db) {
  ASSIGN_OR_RETURN(std::vector<LightTerm> terms, Terms(start, end));
  uint64_t noise_key = sim::Fold(options_.seed, static_cast<uint64_t>((end - start).count()));
  for (const LightTerm& term : terms) noise_key = Fold(noise_key, term);
  Frame frame;
  frame.format = format;
  frame.width = size.width;
  frame.height = size.height;
  frame.significant_bits = SignificantBits(format, bits);
  frame.data = ReadSensor(Render(terms, size), options_.sensor, format, bits, gain_db, noise_key);
  frame.exposure = end - start;
  frame.gain_db = gain_db;
  frame.exposure_start = start;
  frame.exposure_end = end;
  return frame;
}

absl::StatusOr<Frame> World::ExposeNow(Duration exposure, PixelFormat format, FilmSize size,
                                       int bits) {
  const TimePoint now = clock_->Now();
  return Expose(now - exposure, now, format, size, bits);
}

void World::Prefetch(FilmSize size) {
  std::vector<LightTerm> terms;
  {
    MutexLock lock(&mutex_);
    const TimePoint now = clock_->Now();
    terms = TermsLocked(now - std::chrono::microseconds(1), now);
  }
  for (const LightTerm& term : terms) {
    if (term.moving) continue;
    if (term.lamp < 0) {
      transport_.Projector(size, term.pose, Keep::kYes);
    } else {
      transport_.Lamp(size, term.pose, term.lamp, Keep::kYes);
    }
  }
}

}  // namespace lightstage::sim
