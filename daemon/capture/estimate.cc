#include "daemon/capture/estimate.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "daemon/capture/limits.h"
#include "daemon/capture/program.h"

namespace lightstage {
namespace {

Angle HomeOf(const std::optional<AxisInfo>& axis) {
  if (!axis || axis->continuous) return Degrees(0);
  return std::max(axis->min, std::min(axis->max, Degrees(0)));
}

class CostModel {
 public:
  explicit CostModel(const RigFacts& facts)
      : facts_(facts), pose_{HomeOf(facts.turntable), HomeOf(facts.tilt)} {}

  void Add(const Shot& shot) {
    ++(shot.kind == ShotKind::kBasis ? shots_ : extra_shots_);
    if (exposures_ == 0 || !(shot.pose == pose_)) ++positions_;
    Duration readout = facts_.camera.readout;
    Duration gap = std::max(MoveTo(shot.pose), LightTime(shot.condition));
    total_ += exposures_ == 0 ? gap : std::max(gap, readout);
    for (Duration exposure : shot.exposures) total_ += exposure;
    total_ += readout * static_cast<int64_t>(shot.exposures.size() - 1);
    exposures_ += static_cast<int64_t>(shot.exposures.size());
    pose_ = shot.pose;
    lamps_ = shot.condition.lamps;
    pattern_ = shot.condition.pattern.value_or(Pattern());
  }

  Estimate Result() const {
    Estimate estimate;
    estimate.shots = shots_;
    estimate.extra_shots = extra_shots_;
    estimate.exposures = exposures_;
    estimate.positions = positions_;
    estimate.duration_seconds = Seconds(total_ + facts_.camera.readout);
    estimate.bytes =
        (shots_ + extra_shots_) * EstimatedImageBytes(facts_.camera_config, facts_.compression);
    return estimate;
  }

 private:
  Duration MoveTo(const Pose& pose) const {
    Duration time{};
    if (facts_.turntable) time = MoveDuration(*facts_.turntable, pose_.azimuth, pose.azimuth);
    if (facts_.tilt) time = std::max(time, MoveDuration(*facts_.tilt, pose_.tilt, pose.tilt));
    return time;
  }

  Duration LightTime(const Condition& condition) const {
    Duration time{};
    if (condition.lamps != lamps_) time = facts_.lamps->settle;
    if (condition.pattern.value_or(Pattern()) != pattern_) {
      time = std::max(time, facts_.projector->settle);
    }
    return time;
  }

  const RigFacts& facts_;
  Pose pose_;
  std::vector<LampLevel> lamps_;
  Pattern pattern_;  // black
  Duration total_{};
  int64_t shots_ = 0, extra_shots_ = 0, exposures_ = 0, positions_ = 0;
};

// Stored bytes per byte of half-float pixels.
double CompressedShare(const std::string& compression) {
  if (compression == "rle") return 0.89;
  if (compression == "zips") return 0.68;
  if (compression == "zip") return 0.65;
  if (compression == "piz") return 0.60;
  if (compression == "dwaa") return 0.24;
  return 1.0;
}

}  // namespace

absl::StatusOr<Estimate> EstimatePlan(const Plan& plan, const RigFacts& facts) {
  ASSIGN_OR_RETURN(ResolvedPlan resolved, ResolvePlan(plan, facts));
  std::unique_ptr<Program> program = MakeProgram(resolved.plan);
  CostModel model(facts);
  for (NoResults none;;) {
    ASSIGN_OR_RETURN(Step step, program->Next(none));
    const Shot* shot = std::get_if<Shot>(&step);
    // Where a program waits for a person or for results, what follows can not be foreseen.
    if (shot == nullptr) break;
    RETURN_IF_ERROR(CheckShot(*shot, facts));
    model.Add(*shot);
  }
  Estimate estimate = model.Result();
  estimate.notes = std::move(resolved.notes);
  return estimate;
}

int64_t EstimatedImageBytes(const CameraConfig& config, const std::string& compression) {
  constexpr double kHeaderAndRecords = 4096;
  bool grey = SamplesPerPixel(config.format) == 1 && !IsBayer(config.format);
  double pixels = static_cast<double>(config.width) * config.height;
  return std::llround(pixels * (grey ? 1 : 3) * 2 * CompressedShare(compression) +
                      kHeaderAndRecords);
}

}  // namespace lightstage
