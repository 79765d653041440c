#include "sim/rig/fault_plan.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <utility>

namespace lightstage::sim {

FaultPlanOptions ParseFaultPlan(const TomlTable& peer) {
  FaultPlanOptions options;
  options.interval = FromSeconds(peer.Double("fault_interval_s", 0, 86400, 0));
  options.after = FromSeconds(peer.Double("fault_after_s", 0, 86400, 5));
  options.seed = static_cast<uint64_t>(peer.Int("fault_seed", 0, INT64_MAX, 1));
  return options;
}

FaultKind Once(std::string name, std::function<void()> make) {
  return {std::move(name), Duration::zero(), [make = std::move(make)](bool begins) {
            if (begins) make();
          }};
}

FaultPlan::FaultPlan(std::string device, const FaultPlanOptions& options,
                     std::vector<FaultKind> kinds)
    : device_(std::move(device)), options_(options), kinds_(std::move(kinds)) {
  if (options_.interval <= Duration::zero()) return;
  for (const FaultKind& kind : kinds_) spdlog::info("{}: fault to come: {}", device_, kind.name);
  thread_ = std::thread([this] { Run(); });
}

FaultPlan::~FaultPlan() {
  {
    MutexLock lock(&mutex_);
    quit_ = true;
    changed_.SignalAll();
  }
  if (thread_.joinable()) thread_.join();
}

bool FaultPlan::Pass(Duration time) {
  RealClock clock;
  const TimePoint end = clock.Now() + time;
  MutexLock lock(&mutex_);
  for (Duration left; !quit_ && (left = end - clock.Now()) > Duration::zero();) {
    changed_.WaitFor(&mutex_, left);
  }
  return !quit_;
}

void FaultPlan::Run() {
  std::mt19937_64 random(options_.seed);
  std::exponential_distribution<double> waits(1 / Seconds(options_.interval));
  std::vector<size_t> order(kinds_.size());
  std::iota(order.begin(), order.end(), 0);
  size_t next = order.size();
  for (bool goes_on = Pass(options_.after); goes_on;) {
    if (!Pass(FromSeconds(waits(random)))) return;
    if (next == order.size()) {
      std::shuffle(order.begin(), order.end(), random);
      next = 0;
    }
    const FaultKind& kind = kinds_[order[next++]];
    spdlog::warn("{}: fault on purpose: {}", device_, kind.name);
    kind.make(true);
    goes_on = Pass(kind.lasts);
    kind.make(false);
  }
}

}  // namespace lightstage::sim
