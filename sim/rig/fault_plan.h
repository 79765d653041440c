// Faults at random moments, for peers (sim/peers): what goes wrong on real wires sooner or later goes wrong on these often, and as often again
// with the same seed. In a device's table of the rig file:
//
//   [….peer]
//   fault_interval_s = 2     # mean time from one fault's end to the next one's begin; 0, the default: none
//   fault_seed = 7           # default 1
//   fault_after_s = 5        # none before, so that the rig can be opened; the default
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "base/toml.h"

namespace lightstage::sim {

struct FaultPlanOptions {
  Duration interval{};
  Duration after{};
  uint64_t seed = 1;
};

FaultPlanOptions ParseFaultPlan(const TomlTable& peer);

struct FaultKind {
  std::string
      name;  // what the log says: "DEVICE: fault on purpose: NAME"; at first "DEVICE: fault to come: NAME"
  Duration lasts{};                // until it is mended
  std::function<void(bool)> make;  // true: it begins, false: it is mended; on the plan's thread
};

// One that happens at once and mends itself, or stays until the driver mends it.
FaultKind Once(std::string name, std::function<void()> make);

// Makes faults of these kinds, one at a time, while it lives: after exponentially distributed times, in random order, each kind once before any
// comes again. Real time only.
class FaultPlan {
 public:
  FaultPlan(std::string device, const FaultPlanOptions& options, std::vector<FaultKind> kinds);
  ~FaultPlan();  // mends what is broken
  FaultPlan(const FaultPlan&) = delete;
  FaultPlan& operator=(const FaultPlan&) = delete;

 private:
  void Run();
  // False if it is to end.
  bool Pass(Duration time);

  const std::string device_;
  const FaultPlanOptions options_;
  const std::vector<FaultKind> kinds_;
  Mutex mutex_;
  CondVar changed_;
  bool quit_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace lightstage::sim
