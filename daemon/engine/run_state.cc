#include "daemon/engine/run_state.h"

#include <array>
#include <optional>

#include "absl/strings/str_cat.h"
#include "base/status.h"

namespace lightstage {
namespace {

using S = RunState;
constexpr std::nullopt_t no = std::nullopt;

// Rows: from. Columns: event, in the order of RunEvent.
constexpr std::array<std::array<std::optional<RunState>, kRunEvents>, kRunStates> kTable = {{
    // clang-format off
    //                 pause        hold         paused-now  resume       cancel          finished       ended          fail        interrupt
    /* RUNNING     */ {S::kPausing, S::kPausing, no,         no,          S::kCancelling, S::kSucceeded, no,            S::kFailed, S::kInterrupted},
    /* PAUSING     */ {no,          S::kPausing, S::kPaused, no,          S::kCancelling, S::kSucceeded, no,            S::kFailed, S::kInterrupted},
    /* PAUSED      */ {no,          no,          no,         S::kRunning, S::kCancelling, no,            no,            S::kFailed, S::kInterrupted},
    /* CANCELLING  */ {no,          no,          no,         no,          no,             no,            S::kCancelled, S::kFailed, S::kInterrupted},
    /* CANCELLED   */ {no,          no,          no,         no,          no,             no,            no,            no,         no},
    /* SUCCEEDED   */ {no,          no,          no,         no,          no,             no,            no,            no,         no},
    /* FAILED      */ {no,          no,          no,         no,          no,             no,            no,            no,         no},
    /* INTERRUPTED */ {no,          no,          no,         S::kRunning, S::kCancelling, no,            no,            S::kFailed, no},
    // clang-format on
}};

constexpr std::array<std::string_view, kRunStates> kStateNames = {
    "RUNNING",   "PAUSING",   "PAUSED", "CANCELLING",
    "CANCELLED", "SUCCEEDED", "FAILED", "INTERRUPTED"};
constexpr std::array<std::string_view, kRunEvents> kEventNames = {
    "pause", "hold", "paused-now", "resume", "cancel", "finished", "ended", "fail", "interrupt"};

}  // namespace

std::string_view RunStateName(RunState state) { return kStateNames[static_cast<size_t>(state)]; }
std::string_view RunEventName(RunEvent event) { return kEventNames[static_cast<size_t>(event)]; }

absl::StatusOr<RunState> NextState(RunState state, RunEvent event) {
  auto next = kTable[static_cast<size_t>(state)][static_cast<size_t>(event)];
  if (next) return *next;
  return Error(
      absl::StatusCode::kFailedPrecondition, "RUN_STATE",
      absl::StrCat("cannot ", RunEventName(event), " a run that is ", RunStateName(state)),
      {{"state", std::string(RunStateName(state))}, {"event", std::string(RunEventName(event))}});
}

bool IsTerminal(RunState state) {
  for (const auto& next : kTable[static_cast<size_t>(state)])
    if (next) return false;
  return true;
}

absl::StatusOr<RunState> ParseRunState(std::string_view name) {
  for (int i = 0; i < kRunStates; ++i)
    if (kStateNames[i] == name) return static_cast<RunState>(i);
  return Error(absl::StatusCode::kDataLoss, "RUN_STATE_UNKNOWN",
               absl::StrCat("unknown run state '", name, "'"), {{"state", std::string(name)}});
}

}  // namespace lightstage
