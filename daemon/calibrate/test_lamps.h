// Lamps whose light goes on and off so long after the command, and that confirm at another time.
#pragma once

#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "drivers/api/lamps.h"

namespace lightstage {

class TestLamps final : public Lamps {
 public:
  // `shine` is told the greatest level, when it is so; on any thread.
  TestLamps(Clock& clock, Duration delay, Duration settle, std::function<void(double)> shine)
      : clock_(clock), delay_(delay), settle_(settle), shine_(std::move(shine)) {
    info_.identity.name = "lamps";
    info_.count = 40;
    info_.settle = settle;
  }
  const LampsInfo& info() const override { return info_; }
  void Set(const std::vector<float>& levels, TimePoint, Completion<LampsState> done) override {
    const float level = *std::max_element(levels.begin(), levels.end());
    const TimePoint now = clock_.Now();
    clock_.At(now + delay_, [this, level] { shine_(level); });
    clock_.At(now + settle_,
              [levels, done = std::move(done)]() mutable { std::move(done)(LampsState{levels}); });
  }
  void Dark(TimePoint deadline, Completion<LampsState> done) override {
    Set(std::vector<float>(info_.count), deadline, std::move(done));
  }
  absl::Status SetTimeToDark(Duration) override { return absl::OkStatus(); }
  absl::Status Refresh() override { return absl::OkStatus(); }

 private:
  Clock& clock_;
  const Duration delay_, settle_;
  const std::function<void(double)> shine_;
  LampsInfo info_;
};

}  // namespace lightstage
