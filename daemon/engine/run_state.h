// The states of a run and every transition between them. What is not in the table is illegal and says so.
#pragma once

#include <string_view>

#include "absl/status/statusor.h"

namespace lightstage {

enum class RunState {
  kRunning,
  kPausing,     // told to pause; finishing the shot
  kPaused,      // waiting, dark
  kCancelling,  // told to end; storing what was captured
  kCancelled,
  kSucceeded,
  kFailed,
  kInterrupted,  // the daemon ended during the run
};

enum class RunEvent {
  kPause,      // asked by a user
  kHold,       // a fault, an operator request: pause at once
  kPausedNow,  // the engine has reached the boundary and is dark
  kResume,
  kCancel,
  kFinished,   // all shots stored
  kEnded,      // the engine has wound up after a cancel
  kFail,       // an error that resuming cannot mend
  kInterrupt,  // the daemon ends or has ended
};

inline constexpr int kRunStates = 8;
inline constexpr int kRunEvents = 9;

std::string_view RunStateName(RunState state);  // "RUNNING", …: as in the API
std::string_view RunEventName(RunEvent event);  // "pause", …

// Where `event` leads from `state`; FAILED_PRECONDITION / RUN_STATE naming both if it is illegal there.
absl::StatusOr<RunState> NextState(RunState state, RunEvent event);

// No event leads out of it.
bool IsTerminal(RunState state);

absl::StatusOr<RunState> ParseRunState(std::string_view name);

}  // namespace lightstage
