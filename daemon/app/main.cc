// lightstaged: the daemon that owns a relighting rig.

#include <csignal>
#include <filesystem>
#include <iostream>
#include <memory>
#include <new>
#include <string>
#include <system_error>
#include <vector>

#include "CLI/CLI.hpp"
#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "base/env.h"
#include "base/failpoint.h"
#include "base/memory.h"
#include "base/status.h"
#include "base/utf8.h"
#include "base/version.h"
#include "daemon/app/builtin_drivers.h"
#include "daemon/app/discover.h"
#include "daemon/calibrate/latency.h"
#include "daemon/config/rig_file.h"
#include "daemon/engine/facts.h"
#include "daemon/rpc/convert.h"
#include "daemon/rpc/server.h"
#include "daemon/runs/run_manager.h"
#include "daemon/store/data_directory.h"
#include "spdlog/async.h"
#include "spdlog/sinks/stdout_sinks.h"
#include "spdlog/spdlog.h"

namespace lightstage {
namespace {

constexpr char kDefaultAddress[] = "127.0.0.1:7420";

struct Arguments {
  std::string rig_file, data;
  std::vector<std::string> listen;
  bool check = false, discover = false, calibrate_latency = false;
};

absl::StatusOr<std::unique_ptr<RigFile>> LoadRigFile(const std::string& path,
                                                     const DriverRegistry& drivers) {
  ASSIGN_OR_RETURN(std::string text, PosixEnv().ReadInput(path));
  return ParseRigFile(text, path, drivers);
}

// Runs what throws where memory or threads are short, as opening devices may.
absl::Status CatchShortage(absl::FunctionRef<absl::Status()> work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return Error(absl::StatusCode::kResourceExhausted, "MEMORY", "there is not enough memory");
  } catch (const std::system_error& e) {  // a thread that cannot be started
    return Error(absl::StatusCode::kResourceExhausted, "SYSTEM",
                 absl::StrCat("the system does not give what is needed: ", e.what()));
  }
}

// One daemon per data directory comes before any device: a second one must not even open them.
absl::StatusOr<std::unique_ptr<DataDirectory>> OpenData(const Arguments& arguments, Env& env) {
  // Clients are told where a dataset is: that must not depend on where the daemon was started.
  std::error_code error;
  std::string folder = std::filesystem::absolute(arguments.data, error).lexically_normal();
  if (CleanUtf8(folder) != folder) {
    return Error(absl::StatusCode::kInvalidArgument, "DATA_DIRECTORY_NAME",
                 absl::StrCat("data directory ", folder,
                              ": clients are told where their runs are, so "
                              "its name must be UTF-8"));
  }
  if (error) return ErrnoError(error.value(), "find the working directory for", arguments.data);
  return DataDirectory::Open(env, folder);
}

std::unique_ptr<Clock> ClockOf(const RigFile& file) {
  if (file.virtual_time) return std::make_unique<VirtualClock>(RealClock().WallNow());
  return std::make_unique<RealClock>();
}

// What was asked for on standard output is there.
absl::Status Written() {
  if (std::cout.flush()) return absl::OkStatus();
  return Error(absl::StatusCode::kInternal, "OUTPUT_FAILED", "cannot write to standard output");
}

// Until one of `signals` comes.
absl::Status CalibrateLatency(const Arguments& arguments, const RigFile& file,
                              const sigset_t& signals) {
  ASSIGN_OR_RETURN(std::unique_ptr<DataDirectory> data, OpenData(arguments, PosixEnv()));
  std::unique_ptr<Clock> clock = ClockOf(file);
  ASSIGN_OR_RETURN(std::unique_ptr<Rig> rig, Rig::Open(file, *clock));
  ASSIGN_OR_RETURN(const LatencyReport report, MeasureLatency(*rig, [&] {
                     const timespec now{};
                     return sigtimedwait(&signals, nullptr, &now) > 0;
                   }));
  std::cout << LatencyToml(report);
  return Written();
}

// Serves until one of `signals` comes.
absl::Status Serve(const Arguments& arguments, const RigFile& file, const sigset_t& signals) {
  std::unique_ptr<Env> env = MakePosixEnv({.direct_io = file.store.direct_io});
  ASSIGN_OR_RETURN(std::unique_ptr<DataDirectory> data, OpenData(arguments, *env));
  std::unique_ptr<Clock> clock = ClockOf(file);
  ASSIGN_OR_RETURN(std::unique_ptr<Rig> rig, Rig::Open(file, *clock));
  const RigFacts facts = FactsOf(*rig);
  int lamps = static_cast<int>(facts.geometry.brace.lamps.size());
  RunManager runs(*rig, facts, *data, *env,
                  {.write = rpc::PlanToJson, .read = [lamps](const std::string& json) {
                     return rpc::PlanFromJson(json, lamps);
                   }});
  ASSIGN_OR_RETURN(std::unique_ptr<rpc::Server> server,
                   rpc::Server::Start(arguments.listen, *rig, facts, runs));
  for (const std::string& address : server->addresses()) spdlog::info("listening on {}", address);

  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("{}: going down", strsignal(signal));
  runs.Shutdown();
  // Dark and still at once, whatever a client is doing by hand.
  absl::Status stopped =
      rig->Stop(Error(absl::StatusCode::kUnavailable, "DAEMON_ENDING", "the daemon is going down"));
  if (!stopped.ok()) spdlog::error("rig: {}", MessageOf(stopped));
  server.reset();
  return absl::OkStatus();
}

// Who started the daemon may have chosen to ignore some of them, as nohup does.
sigset_t EndingSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (int signal : {SIGTERM, SIGINT, SIGHUP, SIGQUIT}) {
    struct sigaction inherited;
    if (sigaction(signal, nullptr, &inherited) == 0 && inherited.sa_handler == SIG_IGN) continue;
    sigaddset(&signals, signal);
  }
  return signals;
}

int Main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app("lightstaged owns an image-based relighting rig and captures basis images with it.");
  app.set_version_flag("--version", kVersion);
  auto* rig = app.add_option("--rig", arguments.rig_file, "Rig file (TOML)");
  auto* data = app.add_option("--data", arguments.data, "Data directory, made if needed");
  app.add_option(
      "--listen", arguments.listen,
      "unix:PATH or 127.0.0.1:PORT (repeatable; default " + std::string(kDefaultAddress) + ")");
  app.add_flag("--check", arguments.check,
               "Check the rig file and the simulated scene, and exit; touches no device");
  app.add_flag("--discover", arguments.discover,
               "List what is found on every bus, with lines for a rig file, and exit")
      ->excludes(rig);
  app.add_flag(
         "--calibrate-latency", arguments.calibrate_latency,
         "Measure the latency_ms of a camera that runs freely with the rig's own light, print the "
         "line for the rig file, and exit; no daemon may use the rig or --data")
      ->excludes("--check")
      ->excludes("--discover");
  try {
    app.parse(argc, argv);
    if (!arguments.discover && rig->count() == 0) throw CLI::RequiredError("--rig");
    if (!arguments.discover && !arguments.check && data->count() == 0)
      throw CLI::RequiredError("--data");
    if (data->count() > 0 && arguments.data.empty())
      throw CLI::ValidationError("--data", "names no folder");
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  if (arguments.listen.empty()) arguments.listen = {kDefaultAddress};

  KeepFrameMemory();
  auto fail = [](const absl::Status& status) {
    std::cerr << "lightstaged: " << MessageOf(status) << "\n";
    return 1;
  };
  if (absl::Status points = SetFailpointsFromEnvironment(); !points.ok()) return fail(points);
  DriverRegistry drivers;
  const std::shared_ptr<sim::Simulation> simulation = RegisterBuiltinDrivers(drivers);
  if (arguments.discover) {
    Discover(drivers, std::cout);
    const absl::Status written = Written();
    return written.ok() ? 0 : fail(written);
  }
  std::unique_ptr<RigFile> file;
  absl::Status loaded = CatchShortage([&]() -> absl::Status {
    ASSIGN_OR_RETURN(file, LoadRigFile(arguments.rig_file, drivers));
    return arguments.check ? simulation->CheckScene(file->geometry) : absl::OkStatus();
  });
  if (!loaded.ok()) return fail(loaded);
  if (arguments.check) {
    std::cout << arguments.rig_file << ": good\n";
    const absl::Status written = Written();
    return written.ok() ? 0 : fail(written);
  }
  // Before any thread: all of them leave these signals to Serve(). Not before the rig file is read, which can be a pipe.
  const sigset_t signals = EndingSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  absl::Status served = CatchShortage([&] {
    // Written by a thread of its own: a terminal that is held up must hold up no rig. If it is held up for long, the oldest lines go.
    spdlog::set_default_logger(
        spdlog::create_async_nb<spdlog::sinks::stderr_sink_mt>("lightstaged"));
    spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %l %v");
    return arguments.calibrate_latency ? CalibrateLatency(arguments, *file, signals)
                                       : Serve(arguments, *file, signals);
  });
  spdlog::shutdown();
  return served.ok() ? 0 : fail(served);
}

}  // namespace
}  // namespace lightstage

int main(int argc, char** argv) { return lightstage::Main(argc, argv); }
