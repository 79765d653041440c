// The flags that `plan` and `capture` share, and the plan that they mean.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "absl/status/statusor.h"
#include "base/env.h"
#include "client/cli/values.h"
#include "lightstage/v1/plan.pb.h"

namespace lightstage::client {

struct PlanFlags {
  std::string file;  // of a whole plan; then nothing else counts

  // Which program, by subcommand; exactly one without a file.
  CLI::App* light_stage = nullptr;
  CLI::App* projector_4d = nullptr;

  std::vector<double> exposures_us;
  int dark_every = 0;
  int reference_every = 0;
  CountOrAngles azimuths = 32;

  // Light stage.
  std::optional<double> span_deg;
  std::vector<int> lamps;
  std::optional<double> level;
  std::optional<double> tilt_deg;

  // Projector.
  CountOrAngles tilts = 7;
  int grid = 16;
  v1::PatternProfile profile = v1::PATTERN_PROFILE_BOX;
  std::optional<int> influence;
  bool full = false;
};

// Adds --plan and the two programs with their flags to `command`. `flags` must outlive the parsing.
void AddPlanFlags(CLI::App& command, PlanFlags& flags);

// The plan. INVALID_ARGUMENT / USAGE if there is none, or both a file and a program, or the file
// cannot be read.
absl::StatusOr<v1::Plan> MakePlan(const PlanFlags& flags, Env& env);

}  // namespace lightstage::client
