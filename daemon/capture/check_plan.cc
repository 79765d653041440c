#include "daemon/capture/check_plan.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "daemon/capture/limits.h"
#include "daemon/capture/projector_4d.h"

namespace lightstage {
namespace {

constexpr double kSameAngleDegrees = 1e-6;

absl::Status Invalid(std::string_view reason, std::string_view message,
                     const ErrorMetadata& metadata = {}) {
  return Error(absl::StatusCode::kInvalidArgument, reason, message, metadata);
}

// The angles must be finite. `turn`: angles 360° apart are one.
absl::Status CheckDistinct(const std::vector<Angle>& angles, bool turn, std::string_view name,
                           std::string_view reason) {
  std::vector<double> sorted;
  for (Angle angle : angles) sorted.push_back((turn ? WrapTurn(angle) : angle).degrees());
  std::sort(sorted.begin(), sorted.end());
  if (turn && sorted.size() > 1) sorted.push_back(sorted.front() + 360);
  for (size_t i = 1; i < sorted.size(); ++i) {
    if (sorted[i] - sorted[i - 1] >= kSameAngleDegrees) continue;
    return Invalid(reason,
                   absl::StrFormat("%s %g deg is given twice: every position is captured once, and "
                                   "less than %g deg apart they are one",
                                   name, sorted[i - 1], kSameAngleDegrees),
                   {{absl::StrCat(name, "_deg"), absl::StrCat(sorted[i - 1])}});
  }
  return absl::OkStatus();
}

absl::Status CheckAzimuths(const std::vector<Angle>& azimuths, Angle tilt, const RigFacts& facts) {
  if (azimuths.empty()) {
    return Invalid("AZIMUTHS_EMPTY", "the plan has no azimuth: at least one is needed");
  }
  for (Angle azimuth : azimuths) RETURN_IF_ERROR(CheckPose({azimuth, tilt}, facts));
  return CheckDistinct(azimuths, true, "azimuth", "AZIMUTH_DUPLICATE");
}

absl::Status CheckSize(uint64_t basis_shots) {
  if (basis_shots <= kMaxBasisShots) return absl::OkStatus();
  return Invalid(
      "PLAN_TOO_LARGE",
      absl::StrFormat("the plan has %d basis shots; at most %d are possible: take fewer positions, "
                      "lamps or patterns",
                      basis_shots, kMaxBasisShots),
      {{"shots", absl::StrCat(basis_shots)}, {"max_shots", absl::StrCat(kMaxBasisShots)}});
}

absl::Status CheckInterval(std::string_view name, int every) {
  if (every >= 0) return absl::OkStatus();
  return Invalid(
      "FRAME_INTERVAL",
      absl::StrFormat("%s %d: a number of basis shots is needed, or 0 for none", name, every),
      {{std::string(name), absl::StrCat(every)}});
}

absl::Status ResolveExposures(const RigFacts& facts, ResolvedPlan& resolved) {
  std::vector<Duration>& exposures = resolved.plan.common.exposures;
  if (exposures.empty()) exposures = facts.default_exposures;
  RETURN_IF_ERROR(CheckExposures(exposures, facts));
  for (Duration& exposure : exposures) {
    ExposureResult result = facts.validate_exposure(exposure);
    if (result.verdict != ConfigVerdict::kAdjusted) continue;
    resolved.notes.push_back(result.note);
    exposure = result.exposure;
  }
  // Two exposures may have been adjusted to one, or past a limit.
  return Annotate(CheckExposures(exposures, facts), "as the camera adjusts the exposures");
}

// The reachable tilt nearest to the zenith.
Angle ParkedTilt(const RigFacts& facts) {
  if (!facts.tilt) return Degrees(0);
  Angle low = facts.limits.tilt_min, high = facts.limits.tilt_max;
  if (!facts.tilt->continuous) {
    low = std::max(low, facts.tilt->min);
    high = std::min(high, facts.tilt->max);
  }
  return std::max(low, std::min(high, Degrees(0)));
}

absl::Status ResolveLightStage(const RigFacts& facts, const CommonPlan& common,
                               LightStagePlan& plan, std::vector<std::string>& notes) {
  plan.tilt = plan.tilt.value_or(ParkedTilt(facts));
  RETURN_IF_ERROR(CheckAzimuths(plan.azimuths, *plan.tilt, facts));
  if (plan.lamps.empty()) {
    return Invalid("LAMPS_EMPTY", "the plan has no lamp: at least one is needed");
  }
  RETURN_IF_ERROR(CheckSize(uint64_t{plan.azimuths.size()} * plan.lamps.size()));
  // Singly, so that the limit on lamps at once does not count lamps that are lit one after another.
  for (int lamp : plan.lamps) RETURN_IF_ERROR(CheckCondition({{{lamp, plan.level}}, {}}, facts));
  if (plan.level == 0) {
    return Invalid("LAMP_LEVEL", "level 0 lights nothing: a level in (0, 1] is needed",
                   {{"level", "0"}});
  }
  std::vector<int> lamps = plan.lamps;
  std::sort(lamps.begin(), lamps.end());
  auto twice = std::adjacent_find(lamps.begin(), lamps.end());
  if (twice != lamps.end()) {
    return Invalid("LAMP_DUPLICATE", absl::StrFormat("lamp %d is given twice", *twice),
                   {{"lamp", absl::StrCat(*twice)}});
  }
  if (common.reference_every > 0) {
    Condition all;
    for (int lamp : plan.lamps) all.lamps.push_back({lamp, plan.level});
    RETURN_IF_ERROR(Annotate(CheckCondition(all, facts), "reference frames light all lamps"));
  }
  int steps = facts.lamps->steps;
  double real = steps > 0 ? std::round(plan.level * steps) / steps : plan.level;
  if (std::abs(real - plan.level) > 1e-9) {
    notes.push_back(absl::StrFormat("level %g: the lamps have %d steps and will take %.4g",
                                    plan.level, steps, real));
  }
  return absl::OkStatus();
}

absl::Status ResolveProjector4d(const RigFacts& facts, Projector4dPlan& plan,
                                std::vector<std::string>& notes) {
  if (plan.tilts.empty()) {
    return Invalid("TILTS_EMPTY", "the plan has no tilt: at least one is needed");
  }
  RETURN_IF_ERROR(CheckAzimuths(plan.azimuths, plan.tilts[0], facts));
  for (Angle tilt : plan.tilts) RETURN_IF_ERROR(CheckPose({plan.azimuths[0], tilt}, facts));
  RETURN_IF_ERROR(CheckDistinct(plan.tilts, false, "tilt", "TILT_DUPLICATE"));

  // Any pattern of the set shows whether grid and influence are possible.
  Pattern pattern;
  pattern.arrangement =
      plan.influence ? PatternArrangement::kHorizontal : PatternArrangement::kSquare;
  pattern.profile = plan.profile;
  pattern.grid = plan.grid;
  pattern.influence = plan.influence.value_or(0);
  RETURN_IF_ERROR(CheckCondition({{}, pattern}, facts));
  uint64_t positions = uint64_t{plan.tilts.size()} * plan.azimuths.size();
  RETURN_IF_ERROR(CheckSize(positions * PatternsPerPosition(plan)));

  if (plan.order == AxisOrder::kFastest) {
    plan.order = FastestOrder(plan, facts.turntable ? &*facts.turntable : nullptr,
                              facts.tilt ? &*facts.tilt : nullptr);
  }
  if (plan.influence && 2 * (*plan.influence + 1) >= plan.grid) {
    notes.push_back(absl::StrFormat(
        "influence %d with grid %d takes %d patterns per position: the full grid's %d squares cost "
        "no more and need no reconstruction",
        *plan.influence, plan.grid, PatternsPerPosition(plan), plan.grid * plan.grid));
  }
  bool zenith = std::any_of(plan.tilts.begin(), plan.tilts.end(),
                            [](Angle tilt) { return tilt.degrees() == 0; });
  if (zenith && plan.azimuths.size() > 1) {
    notes.push_back(
        absl::StrFormat("tilt 0 is the zenith: its %d azimuths are one position, taken %d times",
                        plan.azimuths.size(), plan.azimuths.size()));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ResolvedPlan> ResolvePlan(const Plan& plan, const RigFacts& facts) {
  ResolvedPlan resolved{plan, {}};
  CommonPlan& common = resolved.plan.common;
  RETURN_IF_ERROR(CheckInterval("dark_every", common.dark_every));
  RETURN_IF_ERROR(CheckInterval("reference_every", common.reference_every));
  RETURN_IF_ERROR(ResolveExposures(facts, resolved));
  if (auto* light_stage = std::get_if<LightStagePlan>(&resolved.plan.kind)) {
    RETURN_IF_ERROR(ResolveLightStage(facts, common, *light_stage, resolved.notes));
  } else {
    RETURN_IF_ERROR(
        ResolveProjector4d(facts, std::get<Projector4dPlan>(resolved.plan.kind), resolved.notes));
  }
  return resolved;
}

}  // namespace lightstage
