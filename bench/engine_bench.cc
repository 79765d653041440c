// What the engine itself costs per shot: null devices that are done at once, a null store, no light, no pictures.
// Goals: 50 µs at the median, 500 µs at the 99th percentile, the same from 1 000 to 57 344 shots, memory too.

#include <cstdio>
#include <fstream>

#include "bench/percentiles.h"
#include "daemon/capture/check_plan.h"
#include "daemon/engine/engine.h"
#include "daemon/engine/facts.h"
#include "daemon/rig/testing/null_rig.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

long ResidentKilobytes() {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line))
    if (line.rfind("VmRSS:", 0) == 0) return std::stol(line.substr(6));
  return 0;
}

// Notes when each shot arrives.
class NullSink final : public ShotSink {
 public:
  explicit NullSink(Clock& clock, size_t shots) : clock_(clock) { arrivals_.reserve(shots); }
  void Put(RawShot shot, std::chrono::nanoseconds, absl::FunctionRef<void()>) override {
    arrivals_.push_back(clock_.Now());
    engine->OnOutcome(shot.shot.id, absl::OkStatus());
  }
  void Drain() override {}
  std::vector<double> Microseconds() const {
    std::vector<double> us;
    for (size_t i = 1; i < arrivals_.size(); ++i)
      us.push_back(Seconds(arrivals_[i] - arrivals_[i - 1]) * 1e6);
    return us;
  }
  Engine* engine = nullptr;

 private:
  Clock& clock_;
  std::vector<TimePoint> arrivals_;
};

int Main() {
  spdlog::set_level(spdlog::level::warn);
  std::printf("%8s %10s %10s %12s %12s %12s\n", "shots", "p50 us", "p99 us", "p50 / 50us",
              "p99 / 500us", "RSS +KiB");
  RealClock clock;
  for (int tilts : {1, 7, 56}) {
    auto file = NullRigFile(clock);
    auto rig = Rig::Open(*file, clock);
    if (!rig.ok()) return std::fprintf(stderr, "%s\n", MessageOf(rig.status()).c_str()), 1;
    RigFacts facts = FactsOf(**rig);
    // 16 × 16 squares: 4 positions are 1 024 shots, 28 are 7 168, 224 are 57 344.
    Plan plan;
    plan.kind = Projector4dPlan{.tilts = CellCentredTilts(tilts),
                                .azimuths = EvenAzimuths(4, Degrees(360))};
    auto resolved = ResolvePlan(plan, facts);
    if (!resolved.ok())
      return std::fprintf(stderr, "%s\n", MessageOf(resolved.status()).c_str()), 1;
    auto program = MakeProgram(resolved->plan);
    NullSink sink(clock, 1024 * tilts);
    NoResults results;
    Engine engine(**rig, facts, *program, results, [](uint64_t) { return false; }, {},
                  {.state_changed = [](RunState, const absl::Status&) {},
                   .finish = [] { return absl::OkStatus(); }});
    sink.engine = &engine;
    if (!(*rig)->Acquire(RigUse::kRun).ok()) return 1;
    long before = ResidentKilobytes();
    RunState end = engine.Run(sink);
    long after = ResidentKilobytes();
    (*rig)->Release();
    std::vector<double> us = sink.Microseconds();
    double p50 = bench::Percentile(us, 0.5), p99 = bench::Percentile(us, 0.99);
    std::printf("%8zu %10.2f %10.2f %12.3f %12.3f %12ld%s\n", us.size() + 1, p50, p99, p50 / 50,
                p99 / 500, after - before, end == RunState::kSucceeded ? "" : "  DID NOT SUCCEED");
  }
  return 0;
}

}  // namespace
}  // namespace lightstage

int main() { return lightstage::Main(); }
