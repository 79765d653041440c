#include "daemon/engine/run_state.h"

#include <map>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using S = RunState;
using E = RunEvent;

// Written out again, from the meaning of states and events, not from the table.
const std::map<std::pair<S, E>, S> kLegal = {
    {{S::kRunning, E::kPause}, S::kPausing},
    {{S::kRunning, E::kHold}, S::kPausing},
    {{S::kRunning, E::kCancel}, S::kCancelling},
    {{S::kRunning, E::kFinished}, S::kSucceeded},
    {{S::kRunning, E::kFail}, S::kFailed},
    {{S::kRunning, E::kInterrupt}, S::kInterrupted},
    {{S::kPausing, E::kHold}, S::kPausing},
    {{S::kPausing, E::kPausedNow}, S::kPaused},
    {{S::kPausing, E::kCancel}, S::kCancelling},
    {{S::kPausing, E::kFinished}, S::kSucceeded},
    {{S::kPausing, E::kFail}, S::kFailed},
    {{S::kPausing, E::kInterrupt}, S::kInterrupted},
    {{S::kPaused, E::kResume}, S::kRunning},
    {{S::kPaused, E::kCancel}, S::kCancelling},
    {{S::kPaused, E::kFail}, S::kFailed},
    {{S::kPaused, E::kInterrupt}, S::kInterrupted},
    {{S::kCancelling, E::kEnded}, S::kCancelled},
    {{S::kCancelling, E::kFail}, S::kFailed},
    {{S::kCancelling, E::kInterrupt}, S::kInterrupted},
    {{S::kInterrupted, E::kResume}, S::kRunning},
    {{S::kInterrupted, E::kCancel}, S::kCancelling},
    {{S::kInterrupted, E::kFail}, S::kFailed},
};

TEST(RunState, EveryCallInEveryState) {
  for (int s = 0; s < kRunStates; ++s) {
    for (int e = 0; e < kRunEvents; ++e) {
      auto state = static_cast<S>(s);
      auto event = static_cast<E>(e);
      auto next = NextState(state, event);
      auto legal = kLegal.find({state, event});
      if (legal != kLegal.end()) {
        ASSERT_TRUE(next.ok()) << next.status();
        EXPECT_EQ(*next, legal->second) << RunStateName(state) << " " << RunEventName(event);
      } else {
        ASSERT_FALSE(next.ok()) << RunStateName(state) << " " << RunEventName(event);
        EXPECT_EQ(next.status().code(), absl::StatusCode::kFailedPrecondition);
        EXPECT_EQ(ErrorReason(next.status()), "RUN_STATE");
        EXPECT_NE(MessageOf(next.status()).find(RunStateName(state)), std::string::npos);
      }
    }
  }
}

TEST(RunState, TerminalStatesAreThree) {
  for (int s = 0; s < kRunStates; ++s) {
    auto state = static_cast<S>(s);
    EXPECT_EQ(IsTerminal(state),
              state == S::kCancelled || state == S::kSucceeded || state == S::kFailed);
  }
}

TEST(RunState, NamesComeBack) {
  for (int s = 0; s < kRunStates; ++s) {
    auto state = static_cast<S>(s);
    EXPECT_EQ(*ParseRunState(RunStateName(state)), state);
  }
  EXPECT_FALSE(ParseRunState("running").ok());
}

}  // namespace
}  // namespace lightstage
