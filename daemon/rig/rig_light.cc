// The rig's light: conditions, darkness, and lamps that must be kept from going dark by themselves.
#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "daemon/rig/device_errors.h"
#include "daemon/rig/rig.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

absl::Status NotConfirmed(const std::string& message, const ErrorMetadata& metadata) {
  return Error(absl::StatusCode::kAborted, "LIGHT_NOT_CONFIRMED", message, metadata);
}

// Levels may be as coarse as the lamps' steps, but nothing else, and a lamp that should shine must not be dark.
absl::Status CheckConfirmed(const LampsInfo& info, const std::vector<float>& asked,
                            const std::vector<float>& confirmed) {
  if (confirmed.size() != asked.size()) {
    return NotConfirmed(
        absl::StrFormat("lamps: %d levels confirmed for %d lamps", confirmed.size(), asked.size()),
        {{"levels", absl::StrCat(confirmed.size())}});
  }
  const float tolerance = info.steps > 0 ? 0.5f / static_cast<float>(info.steps) + 1e-4f : 1e-3f;
  for (size_t i = 0; i < asked.size(); ++i) {
    bool near = std::abs(confirmed[i] - asked[i]) <= tolerance;
    if (near && (asked[i] > 0) == (confirmed[i] > 0)) continue;
    return NotConfirmed(
        absl::StrFormat("lamp %d: set to %g, the device confirmed %g", i, asked[i], confirmed[i]),
        {{"lamp", absl::StrCat(i)},
         {"asked", absl::StrCat(asked[i])},
         {"confirmed", absl::StrCat(confirmed[i])}});
  }
  return absl::OkStatus();
}

}  // namespace

std::unique_ptr<Rig::Lighting> Rig::StartCondition(const Condition& condition) {
  auto lighting = std::make_unique<Lighting>();
  lighting->rig_ = this;
  Duration settle{};
  if (lamps_) {
    lighting->levels_.assign(lamps_->info().count, 0.0f);
    settle = lamps_->info().settle;
  } else if (!condition.lamps.empty()) {
    lighting->refused_ = MissingDevice("lamps", "lamps");
    return lighting;
  }
  if (!projector_ && condition.pattern) {
    lighting->refused_ = MissingDevice("projector", "a pattern");
    return lighting;
  }
  if (projector_) settle = std::max(settle, projector_->info().settle);
  for (const LampLevel& lamp : condition.lamps) {
    if (lamp.lamp < 0 || lamp.lamp >= static_cast<int>(lighting->levels_.size())) {
      lighting->refused_ = Error(absl::StatusCode::kInvalidArgument, "UNKNOWN_LAMP",
                                 absl::StrFormat("lamp %d: the brace has lamps 0 to %d", lamp.lamp,
                                                 static_cast<int>(lighting->levels_.size()) - 1),
                                 {{"lamp", absl::StrCat(lamp.lamp)}});
      return lighting;
    }
    lighting->levels_[lamp.lamp] = static_cast<float>(lamp.level);
  }
  lighting->pattern_ = condition.pattern.value_or(Pattern{});
  lighting->deadline_ = clock_.Now() + settle + device_timeout();

  MutexLock lock(&gate_);
  lighting->since_ = disturbances_;
  lighting->refused_ = CheckRunningLocked();
  if (!lighting->refused_.ok()) return lighting;
  bool set_lamps, show;
  {
    MutexLock state_lock(&state_mutex_);
    set_lamps = lamps_ && lighting->levels_ != lamps_asked_;
    show = projector_ && lighting->pattern_ != pattern_;
    // Until confirmed, unknown: a failed command must not count as "already showing it".
    if (set_lamps) {
      lamp_levels_.assign(lamp_levels_.size(), std::nanf(""));
      lamps_asked_ = lamp_levels_;
    }
    if (show) pattern_.reset();
  }
  lighting->command_ = set_lamps || show ? ++light_commands_ : light_commands_;
  if (set_lamps) {
    {
      MutexLock state_lock(&state_mutex_);
      KeepLitLocked(lighting->levels_);
    }
    lighting->lamps_.emplace(clock_);
    lamps_->Set(lighting->levels_, lighting->deadline_, lighting->lamps_->sink());
  }
  if (show) {
    lighting->projector_.emplace(clock_);
    projector_->Show(lighting->pattern_, lighting->deadline_, lighting->projector_->sink());
  }
  return lighting;
}

absl::Status Rig::Lighting::Wait() {
  absl::Status first = refused_;
  TimePoint deadline = deadline_ + rig_->device_timeout();
  absl::StatusOr<LampsState> lit;
  if (lamps_) {
    lit = lamps_->Wait(deadline, "lamps: set");
    absl::Status status = lit.status();
    if (status.ok()) status = CheckConfirmed(rig_->lamps_->info(), levels_, lit->levels);
    if (!status.ok()) lit = status;
    if (first.ok()) first = Named(status, "lamps");
  }
  absl::StatusOr<ProjectorState> shown;
  if (projector_) {
    shown = projector_->Wait(deadline, "projector: show");
    absl::Status status = shown.status();
    if (status.ok() && shown->shown != pattern_) {
      status = NotConfirmed(
          absl::StrFormat("told to show %s, it shows %s", PatternName(pattern_),
                          PatternName(shown->shown)),
          {{"asked", PatternName(pattern_)}, {"confirmed", PatternName(shown->shown)}});
      shown = status;
    }
    if (first.ok()) first = Named(status, "projector");
  }

  MutexLock gate(&rig_->gate_);
  // What was confirmed before a stop or halt is not what there is now.
  absl::Status undisturbed = rig_->CheckUndisturbedLocked(since_);
  if (first.ok()) first = undisturbed;
  const bool latest = undisturbed.ok() && command_ == rig_->light_commands_;
  MutexLock state(&rig_->state_mutex_);
  if (latest && lamps_ && lit.ok()) {
    rig_->lamp_levels_ = lit->levels;
    rig_->lamps_asked_ = levels_;
  }
  if (latest && projector_ && shown.ok()) rig_->pattern_ = shown->shown;
  if (latest && first.ok()) {
    if (lamps_) rig_->lit_at_ = std::max(rig_->lit_at_, lamps_->done_at());
    if (projector_) rig_->lit_at_ = std::max(rig_->lit_at_, projector_->done_at());
  }
  lit_at_ = rig_->lit_at_;
  confirmed_ = rig_->lamp_levels_;
  return first;
}

absl::Status Rig::CheckLight() {
  const TimePoint deadline = clock_.Now() + device_timeout();
  std::optional<Pending<std::monostate>> lamps, projector;
  if (lamps_) lamps_->Check(deadline, lamps.emplace(clock_).sink());
  if (projector_) projector_->Check(deadline, projector.emplace(clock_).sink());
  const auto wait = [&](std::optional<Pending<std::monostate>>& asked, const char* device) {
    if (!asked) return absl::OkStatus();
    return Annotate(
        asked->Wait(deadline + device_timeout(), "the light after the exposure").status(), device);
  };
  absl::Status lit = wait(lamps, "lamps"), shown = wait(projector, "projector");
  if (lit.ok() && shown.ok()) return lit;
  MutexLock lock(&state_mutex_);
  if (!lit.ok()) {
    lamp_levels_.assign(lamp_levels_.size(), std::nanf(""));
    lamps_asked_ = lamp_levels_;
  }
  if (!shown.ok()) pattern_.reset();
  return lit.ok() ? shown : lit;
}

// ---- The lamps' time-to-dark

// From the command on, not from its confirmation: a long move may lie between the two.
void Rig::KeepLitLocked(const std::vector<float>& levels) {
  if (time_to_dark_ == Duration::zero()) return;
  refreshed_at_ = clock_.Now();
  keep_lit_ = std::any_of(levels.begin(), levels.end(), [](float level) { return level > 0; });
  if (refreshing_ || !keep_lit_) return;
  refreshing_ = true;
  ScheduleRefreshLocked();
}

void Rig::ScheduleRefreshLocked() {
  clock_.At(clock_.Now() + time_to_dark_ / 3, [guard = refresh_guard_] {
    MutexLock lock(&guard->mutex);
    if (guard->rig) guard->rig->RefreshLamps();
  });
}

void Rig::RefreshLamps() {
  TimePoint asked = clock_.Now();
  {
    MutexLock lock(&state_mutex_);
    refreshing_ = keep_lit_;
    if (!refreshing_) return;
  }
  absl::Status refreshed = lamps_->Refresh();
  if (!refreshed.ok()) spdlog::warn("lamps: refresh failed: {}", MessageOf(refreshed));
  MutexLock gate(&gate_);
  MutexLock lock(&state_mutex_);
  // By now it may have come too late; whoever exposes asks again.
  CheckStillLitLocked();
  if (!keep_lit_) {
    refreshing_ = false;
    return;
  }
  if (refreshed.ok()) refreshed_at_ = std::max(refreshed_at_, asked);
  ScheduleRefreshLocked();
}

void Rig::CheckStillLitLocked() {
  if (!keep_lit_) return;
  const Duration silence = clock_.Now() - refreshed_at_;
  if (silence <= time_to_dark_) return;
  spdlog::error("lamps: no sign of life for {:.3f} s: they have gone dark by themselves",
                Seconds(silence));
  ++disturbances_;
  keep_lit_ = false;
  lamp_levels_.assign(lamp_levels_.size(), std::nanf(""));
  lamps_asked_ = lamp_levels_;
}

// ---- Dark

Rig::Darkening Rig::StartDarkLocked() {
  Darkening darkening;
  darkening.lighting = light_commands_;
  TimePoint deadline = clock_.Now() + device_timeout();
  if (lamps_) {
    {
      MutexLock lock(&state_mutex_);
      keep_lit_ = false;  // also if this fails: then their timer is what makes them dark
    }
    darkening.lamps.emplace(clock_);
    darkening.lamps_deadline = deadline + lamps_->info().settle;
    lamps_->Dark(darkening.lamps_deadline, darkening.lamps->sink());
  }
  if (projector_) {
    darkening.projector.emplace(clock_);
    darkening.projector_deadline = deadline + projector_->info().settle;
    projector_->Black(darkening.projector_deadline, darkening.projector->sink());
  }
  return darkening;
}

absl::Status Rig::FinishDark(Darkening& darkening) {
  absl::Status lamps, projector;
  if (darkening.lamps) {
    auto state = darkening.lamps->Wait(darkening.lamps_deadline + device_timeout(), "lamps: dark");
    lamps = state.status();
    if (lamps.ok()) {
      lamps = CheckConfirmed(lamps_->info(), std::vector<float>(lamps_->info().count, 0.0f),
                             state->levels);
    }
  }
  if (darkening.projector) {
    projector = darkening.projector
                    ->Wait(darkening.projector_deadline + device_timeout(), "projector: black")
                    .status();
  }
  MutexLock gate(&gate_);
  if (darkening.lighting == light_commands_) {  // else light has been asked for meanwhile
    MutexLock lock(&state_mutex_);
    lamp_levels_.assign(lamp_levels_.size(), lamps.ok() ? 0.0f : std::nanf(""));
    lamps_asked_ = lamp_levels_;
    pattern_.reset();
    if (projector.ok()) pattern_ = Pattern{};
  }
  return lamps.ok() ? Named(projector, "projector") : Named(lamps, "lamps");
}

absl::Status Rig::Dark() {
  Darkening darkening;
  {
    MutexLock lock(&gate_);
    darkening = StartDarkLocked();
  }
  return FinishDark(darkening);
}

}  // namespace lightstage
