// How near a run on real time comes to its physical bound: exposures, readouts, and motion and light that cannot overlap them
// (daemon/capture/estimate.h). Goal: at most 1.05. Usage: realtime_bench RIG.toml [azimuths]

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "absl/time/clock.h"
#include "base/env.h"
#include "daemon/app/builtin_drivers.h"
#include "daemon/capture/check_plan.h"
#include "daemon/engine/facts.h"
#include "daemon/rpc/convert.h"
#include "daemon/runs/run_manager.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

absl::Status Measure(const std::string& path, int azimuths) {
  ASSIGN_OR_RETURN(std::string text, PosixEnv().ReadFile(path));
  DriverRegistry drivers;
  RegisterBuiltinDrivers(drivers);
  ASSIGN_OR_RETURN(std::unique_ptr<RigFile> file, ParseRigFile(text, path, drivers));
  if (file->virtual_time) return absl::InvalidArgumentError("the rig must be on real time");
  RealClock clock;
  ASSIGN_OR_RETURN(std::unique_ptr<Rig> rig, Rig::Open(*file, clock));
  RETURN_IF_ERROR(rig->HomeAll());
  RigFacts facts = FactsOf(*rig);
  std::string folder = std::filesystem::temp_directory_path() / "lightstage-realtime-bench";
  std::filesystem::remove_all(folder);
  ASSIGN_OR_RETURN(auto data, DataDirectory::Open(PosixEnv(), folder));
  RunManager runs(*rig, facts, *data, PosixEnv(),
                  {.write = rpc::PlanToJson,
                   .read = [](const std::string& json) { return rpc::PlanFromJson(json, 40); }});
  Plan plan;
  plan.kind =
      LightStagePlan{.azimuths = EvenAzimuths(azimuths, Degrees(180)),
                     .lamps = AllLamps(static_cast<int>(facts.geometry.brace.lamps.size()))};
  ASSIGN_OR_RETURN(Estimate bound, EstimatePlan(plan, facts));
  absl::Time start = absl::Now();
  ASSIGN_OR_RETURN(std::string id, runs.Start(plan, "bench"));
  RunView run;
  do {
    absl::SleepFor(absl::Milliseconds(5));
    ASSIGN_OR_RETURN(run, runs.Get(id));
  } while (run.state == RunState::kRunning);
  double took = absl::ToDoubleSeconds(absl::Now() - start);
  std::printf("%s: %d shots, %s, took %.3f s, bound %.3f s, ratio %.4f (goal 1.05)\n", path.c_str(),
              static_cast<int>(run.done_shots), std::string(RunStateName(run.state)).c_str(), took,
              bound.duration_seconds, took / bound.duration_seconds);
  runs.Shutdown();
  std::filesystem::remove_all(folder);
  return absl::OkStatus();
}

}  // namespace
}  // namespace lightstage

int main(int argc, char** argv) {
  spdlog::set_level(spdlog::level::warn);
  if (argc < 2) return std::fprintf(stderr, "usage: realtime_bench RIG.toml [azimuths]\n"), 2;
  absl::Status measured = lightstage::Measure(argv[1], argc > 2 ? std::atoi(argv[2]) : 8);
  if (!measured.ok()) std::fprintf(stderr, "%s\n", lightstage::MessageOf(measured).c_str());
  return measured.ok() ? 0 : 1;
}
