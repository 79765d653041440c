// The daemon and its command line, as a user has them.
//
// The programs are those of this build; LIGHTSTAGE_BIN may name a folder to take them from instead.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"
#include "tests/harness/process.h"

namespace lightstage {

using Json = nlohmann::json;

std::string DaemonProgram();
std::string CtlProgram();
std::string RelightProgram();

// tests/e2e/rigs/small.toml.
std::string SmallRig();
// `text` with `from`, which must be in it, replaced.
std::string Replaced(std::string text, const std::string& from, const std::string& to);
inline std::string RealTime(const std::string& rig) {
  return Replaced(rig, "time = \"fast\"", "time = \"real\"");
}
inline std::string WithoutNoise(const std::string& rig) {
  return Replaced(Replaced(rig, "photon_noise = true", "photon_noise = false"), "read_noise_e = 4",
                  "read_noise_e = 0");
}
inline std::string WithFaults(const std::string& rig, const std::string& faults) {
  return rig + "\n[simulation.faults]\n" + faults + "\n";
}

// How a command ended.
struct Answer {
  int code = -1;
  std::string out, err;
  std::vector<Json> lines;  // of standard output, if it was asked for as JSON

  const Json& json() const;  // the last line; fails the test if there is none
};

// One lightstaged on `folder`/data, listening on `folder`/socket.
class Daemon {
 public:
  struct Options {
    std::string data = "data";  // below the folder, unless absolute
    std::string failpoints;     // LIGHTSTAGED_FAILPOINTS
    bool wait_until_ready = true;
  };
  Daemon(const TestFolder& folder, const std::string& rig, const Options& options);
  Daemon(const TestFolder& folder, const std::string& rig) : Daemon(folder, rig, Options()) {}
  ~Daemon();

  Process& process() { return *process_; }
  std::string address() const { return "unix:" + socket_; }
  const std::string& data() const { return data_; }
  std::string log() const { return process_->err(); }
  int Terminate();  // SIGTERM; the exit code
  void Kill();      // SIGKILL

  // lightstagectl with these arguments, --format json and, unless they name another, this daemon's address.
  Answer Ctl(const std::vector<std::string>& arguments);
  // The same, still running. With `format` as given.
  std::unique_ptr<Process> Start(const std::vector<std::string>& arguments,
                                 const std::string& format = "json");
  // Starts a run without watching it; its name.
  std::string StartRun(std::vector<std::string> plan);
  // Captures to the end, which must be success.
  std::string Capture(std::vector<std::string> plan);

  Json State();                       // RigState
  Json Run(const std::string& name);  // Run
  // Waits for a run's state (without RUN_STATE_) and returns the run; fails the test if it does not come.
  Json WaitForRun(const std::string& name, const std::string& state,
                  Milliseconds patience = Milliseconds(60000));
  // Waits until so many shots are stored, or more.
  void WaitForShots(const std::string& name, int shots);
  std::filesystem::path RunFolder(const std::string& name) const;

 private:
  std::string log_folder_, socket_, data_;
  int commands_ = 0;
  std::unique_ptr<Process> process_;
};

// True if light is on anywhere, as `state` tells it.
bool Lit(const Json& state);

// The problems that `runs verify` found: file to reason.
std::map<std::string, std::string> Problems(const Answer& verify);

}  // namespace lightstage
