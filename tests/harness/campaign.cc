#include "tests/harness/campaign.h"

#include <algorithm>
#include <cstdio>
#include <map>

#include "gtest/gtest.h"
#include "tests/harness/compare.h"

namespace lightstage {
namespace {

// The faults that were made, "DEVICE: KIND", and how often each.
std::map<std::string, size_t> FaultsIn(const std::string& log) {
  constexpr std::string_view kMark = ": fault on purpose: ";
  std::map<std::string, size_t> faults;
  for (size_t at = 0; (at = log.find(kMark, at)) != std::string::npos; at += kMark.size()) {
    const size_t device = log.rfind(' ', at) + 1, kind = at + kMark.size();
    ++faults[log.substr(device, at - device) + ": " +
             log.substr(kind, log.find('\n', kind) - kind)];
  }
  return faults;
}

size_t Sum(const std::map<std::string, size_t>& counts) {
  size_t sum = 0;
  for (const auto& [what, count] : counts) sum += count;
  return sum;
}

// What is said to be lit; a lamp of which nobody knows has no number.
std::string StillLit(const Json& state) {
  for (const Json& lamp : state.value("lamps", Json::array())) {
    if (lamp.contains("level") && lamp["level"].is_number() && lamp["level"] > 0)
      return lamp.dump();
  }
  const Json pattern = state.value("pattern", Json());
  if (!pattern.is_null() && pattern.value("arrangement", "") != "PATTERN_ARRANGEMENT_BLACK") {
    return pattern.dump();
  }
  return "";
}

// A pause is dark, and its reason names a device that had a fault.
void ExpectGoodPause(const Json& run, const Json& state, const std::string& log) {
  const std::string message = run["reason"].value("message", "");
  bool named = false;
  for (const auto& [fault, count] : FaultsIn(log)) {
    named |= message.find(fault.substr(0, fault.find(':'))) != std::string::npos;
  }
  EXPECT_TRUE(named) << "names no device that had a fault: " << run["reason"].dump();
  EXPECT_EQ(StillLit(state), "") << "paused, but lit: " << run["reason"].dump();
}

void PrintCounts(const char* what, const std::map<std::string, size_t>& counts) {
  std::printf("%s", what);
  const char* separator = " ";
  for (const auto& [name, count] : counts) {
    std::printf("%s%zu %s", separator, count, name.c_str());
    separator = ", ";
  }
}

// Resets the rig and then does `command`, again and again: a fault may come in between. The last answer.
Answer AfterReset(Daemon& daemon, const std::vector<std::string>& command) {
  Answer last;
  WaitUntil(Milliseconds(60000), [&] {
    last = daemon.Ctl({"reset"});
    if (last.code == 0) last = daemon.Ctl(command);
    return last.code == 0;
  });
  return last;
}

}  // namespace

void Campaign(const std::string& direct_rig, const std::string& faulty_rig,
              const std::vector<std::string>& plan, size_t faults, double exposure_s) {
  TestFolder folder;
  const std::filesystem::path direct = DirectRun(folder, direct_rig, plan);
  Daemon daemon(folder, faulty_rig);
  int runs = 0, images = 0, retakes = 0;
  double worst = 0;
  std::map<std::string, size_t> pauses;  // by reason
  std::vector<std::string> capture = {"capture", "--detach"};
  capture.insert(capture.end(), plan.begin(), plan.end());
  while (Sum(FaultsIn(daemon.log())) < faults) {
    const Answer started = AfterReset(daemon, capture);
    ASSERT_EQ(started.code, 0) << started.err;
    const std::string run = started.json()["run"]["name"];
    Json now;
    for (bool ended = false; !ended;) {
      ASSERT_TRUE(WaitUntil(Milliseconds(120000), [&] {
        now = daemon.Run(run);
        return now["state"] == "RUN_STATE_PAUSED" || now["state"] == "RUN_STATE_SUCCEEDED";
      })) << now.dump(1);
      ended = now["state"] == "RUN_STATE_SUCCEEDED";
      if (ended) break;
      ++pauses[now["reason"].value("reason", "")];
      ExpectGoodPause(now, daemon.State(), daemon.log());
      const Answer resumed = AfterReset(daemon, {"runs", "resume", run});
      ASSERT_EQ(resumed.code, 0) << resumed.err;
    }
    retakes += now.value("retakes", 0);
    const BasisComparison same = CompareBasis(direct, daemon.RunFolder(run), 12, exposure_s);
    ++runs;
    images += same.images;
    worst = std::max(worst, same.worst);
    EXPECT_LE(same.worst, 1.0) << same.where << " of run " << runs;
    EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  }
  const std::map<std::string, size_t> made = FaultsIn(daemon.log());
  std::printf(
      "measured: %zu faults in %d runs: %d images, %d retakes, worst difference %.3f of a code;",
      Sum(made), runs, images, retakes, worst);
  PrintCounts(" pauses:", pauses);
  PrintCounts("; faults:", made);
  std::printf("\n");
  EXPECT_EQ(daemon.Terminate(), 0);
}

}  // namespace lightstage
