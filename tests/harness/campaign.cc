#include "tests/harness/campaign.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <string_view>
#include <utility>

#include "gtest/gtest.h"
#include "tests/harness/compare.h"

namespace lightstage {
namespace {

// Runs that may go by without a fault in them.
constexpr int kMostUndisturbed = 15;

// What the log says after "DEVICE`mark`": "DEVICE: KIND", and how often each.
std::map<std::string, size_t> Said(std::string_view log, std::string_view mark) {
  std::map<std::string, size_t> said;
  for (size_t at = 0; (at = log.find(mark, at)) != std::string::npos; at += mark.size()) {
    const size_t device = log.rfind(' ', at) + 1, kind = at + mark.size();
    const size_t end = log.find('\n', kind);
    ++said[std::string(log.substr(device, at - device)) + ": " +
           std::string(log.substr(kind, end - kind))];
  }
  return said;
}
std::map<std::string, size_t> FaultsIn(std::string_view log) {
  return Said(log, ": fault on purpose: ");
}

size_t Sum(const std::map<std::string, size_t>& counts) {
  size_t sum = 0;
  for (const auto& [what, count] : counts) sum += count;
  return sum;
}

bool HadAFault(std::string_view log, const std::string& device) {
  return log.find(device + ": fault on purpose: ") != std::string_view::npos;
}

// What is said to be lit, or not known to be dark although the device had no fault lately; a lamp of which nobody knows has no number.
std::string StillLit(const Json& state, std::string_view log) {
  for (const Json& lamp : state.value("lamps", Json::array())) {
    const Json level = lamp.value("level", Json(0));
    if (level.is_number() ? level > 0 : !HadAFault(log, "lamps")) return lamp.dump();
  }
  if (state.value("patternUnknown", false) && !HadAFault(log, "projector")) return "unknown";
  const Json pattern = state.value("pattern", Json());
  if (!pattern.is_null() && pattern.value("arrangement", "") != "PATTERN_ARRANGEMENT_BLACK") {
    return pattern.dump();
  }
  return "";
}

// A pause is dark, and its reason names a device that had a fault since the last but one: it may last beyond the last.
void ExpectGoodPause(const Json& run, const Json& state, const std::string& log,
                     size_t before_last) {
  const std::string message = run["reason"].value("message", "");
  const std::string_view since = std::string_view(log).substr(before_last);
  bool named = false;
  for (const auto& [fault, count] : FaultsIn(since)) {
    named |= message.find(fault.substr(0, fault.find(':'))) != std::string::npos;
  }
  EXPECT_TRUE(named) << "names no device that had a fault: " << run["reason"].dump() << "\n"
                     << since;
  EXPECT_NE(run["reason"].value("reason", ""), "");
  EXPECT_EQ(StillLit(state, since), "") << "paused, but lit: " << run["reason"].dump();
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
  size_t before_last = 0, last = 0;  // places in the log: of the pauses before
  int runs = 0, images = 0;
  size_t retakes = 0;
  double worst = 0;
  std::map<std::string, size_t> pauses;  // by reason
  std::vector<std::string> capture = {"capture", "--detach"};
  capture.insert(capture.end(), plan.begin(), plan.end());
  // Faults that all came between runs disturb nothing: more runs will be.
  while (Sum(FaultsIn(daemon.log())) < faults ||
         (retakes + Sum(pauses) == 0 && runs < kMostUndisturbed)) {
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
      ExpectGoodPause(now, daemon.State(), daemon.log(), before_last);
      before_last = std::exchange(last, daemon.log().size());
      const Answer resumed = AfterReset(daemon, {"runs", "resume", run});
      ASSERT_EQ(resumed.code, 0) << resumed.err;
    }
    retakes += now.value("retakes", size_t{0});
    const BasisComparison same = CompareBasis(direct, daemon.RunFolder(run), 12, exposure_s);
    ++runs;
    images += same.images;
    worst = std::max(worst, same.worst);
    EXPECT_LE(same.worst, 1.0) << same.where << " of run " << runs;
    EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  }
  const std::map<std::string, size_t> made = FaultsIn(daemon.log());
  std::printf(
      "measured: %zu faults in %d runs: %d images, %zu retakes, worst difference %.3f of a code;",
      Sum(made), runs, images, retakes, worst);
  PrintCounts(" pauses:", pauses);
  PrintCounts("; faults:", made);
  std::printf("\n");
  EXPECT_GT(retakes + Sum(pauses), 0u) << "faults that disturb nothing";
  if (faults >= 50) {
    for (const auto& [kind, plans] : Said(daemon.log(), ": fault to come: ")) {
      EXPECT_TRUE(made.contains(kind)) << kind << " never came";
    }
  }
  EXPECT_EQ(daemon.Terminate(), 0);
}

}  // namespace lightstage
