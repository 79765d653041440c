#include "tests/harness/daemon.h"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <sstream>

#include "gtest/gtest.h"

namespace lightstage {
namespace {

std::string Program(const char* built, const char* name) {
  const char* folder = std::getenv("LIGHTSTAGE_BIN");
  return folder != nullptr ? std::string(folder) + "/" + name : std::string(built);
}

// Whole lines only: a program that was killed may have left half of one.
std::vector<Json> ParseLines(const std::string& text) {
  std::vector<Json> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line) && !stream.eof();) {
    Json json = Json::parse(line, nullptr, /*allow_exceptions=*/false);
    EXPECT_TRUE(json.is_object()) << "standard output is not JSON: " << line;
    lines.push_back(std::move(json));
  }
  return lines;
}

}  // namespace

std::string DaemonProgram() { return Program(LIGHTSTAGED_PROGRAM, "lightstaged"); }
std::string CtlProgram() { return Program(LIGHTSTAGECTL_PROGRAM, "lightstagectl"); }
std::string RelightProgram() { return Program(RELIGHT_PROGRAM, "relight"); }

std::string SmallRig() { return ReadText(LIGHTSTAGE_SOURCE_DIR "/tests/e2e/rigs/small.toml"); }

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

const Json& Answer::json() const {
  static const Json kNothing = Json::object();
  EXPECT_FALSE(lines.empty()) << "no answer; exit code " << code << ", " << err;
  return lines.empty() ? kNothing : lines.back();
}

Daemon::Daemon(const TestFolder& folder, const std::string& rig, const Options& options)
    : socket_(folder / "socket"), data_((folder.path() / options.data).string()) {
  static int number = 0;
  log_folder_ = folder / ("log" + std::to_string(++number));
  std::filesystem::create_directory(log_folder_);
  std::string rig_file = folder / "rig.toml";
  WriteText(rig_file, rig);
  process_ = std::make_unique<Process>(
      std::vector<std::string>{DaemonProgram(), "--rig", rig_file, "--data", data_, "--listen",
                               address()},
      log_folder_ + "/daemon",
      std::map<std::string, std::string>{{"LIGHTSTAGED_FAILPOINTS", options.failpoints}});
  if (!options.wait_until_ready) return;
  Answer status = Ctl({"status", "--wait", "20"});
  EXPECT_EQ(status.code, 0) << status.err << log();
}

Daemon::~Daemon() {
  if (testing::Test::HasFailure()) std::cerr << "---- the daemon's log\n" << log() << "----\n";
}

int Daemon::Terminate() {
  process_->Signal(SIGTERM);
  return process_->Wait(Milliseconds(30000));
}

void Daemon::Kill() {
  process_->Signal(SIGKILL);
  process_->Wait();
}

std::unique_ptr<Process> Daemon::Start(const std::vector<std::string>& arguments,
                                       const std::string& format) {
  std::vector<std::string> all = {CtlProgram(), "--format", format};
  if (std::find(arguments.begin(), arguments.end(), "--address") == arguments.end())
    all.insert(all.end(), {"--address", address()});
  all.insert(all.end(), arguments.begin(), arguments.end());
  return std::make_unique<Process>(all, log_folder_ + "/ctl" + std::to_string(++commands_));
}

Answer Daemon::Ctl(const std::vector<std::string>& arguments) {
  std::unique_ptr<Process> process = Start(arguments);
  Answer answer;
  answer.code = process->Wait(Milliseconds(120000));
  answer.out = process->out();
  answer.err = process->err();
  answer.lines = ParseLines(answer.out);
  return answer;
}

std::string Daemon::StartRun(std::vector<std::string> plan) {
  plan.insert(plan.begin(), {"capture", "--detach"});
  Answer answer = Ctl(plan);
  EXPECT_EQ(answer.code, 0) << answer.err;
  const Json& json = answer.json();
  return json.contains("run") ? json["run"]["name"].get<std::string>() : "runs/none";
}

std::string Daemon::Capture(std::vector<std::string> plan) {
  std::string run = StartRun(std::move(plan));
  WaitForRun(run, "SUCCEEDED", Milliseconds(200000));
  return run;
}

Json Daemon::State() {
  Json state = Ctl({"status"}).json();
  return state.contains("state") ? state["state"] : state;
}

Json Daemon::Run(const std::string& name) {
  Json run = Ctl({"runs", "show", name}).json();
  return run.contains("run") ? run["run"] : run;
}

Json Daemon::WaitForRun(const std::string& name, const std::string& state, Milliseconds patience) {
  Json run;
  bool came = WaitUntil(patience, [&] {
    run = Run(name);
    return run.value("state", "") == "RUN_STATE_" + state;
  });
  EXPECT_TRUE(came) << "wanted " << state << ", is " << run.dump(1);
  return run;
}

void Daemon::WaitForShots(const std::string& name, int shots) {
  EXPECT_TRUE(WaitUntil(Milliseconds(60000), [&] {
    return Run(name).value("doneShots", 0) >= shots;
  })) << Run(name).dump(1);
}

std::filesystem::path Daemon::RunFolder(const std::string& name) const {
  return std::filesystem::path(data_) / name;
}

bool Lit(const Json& state) {
  if (!state.value("lamps", Json::array()).empty()) return true;
  return state.contains("pattern") &&
         state["pattern"]["arrangement"] != "PATTERN_ARRANGEMENT_BLACK";
}

std::map<std::string, std::string> Problems(const Answer& verify) {
  std::map<std::string, std::string> problems;
  for (const Json& line : verify.lines) {
    for (const Json& problem : line.value("problems", Json::array()))
      problems[problem["file"]] = problem["reason"]["reason"];
  }
  return problems;
}

}  // namespace lightstage
