#include "tests/harness/campaign.h"

#include <algorithm>
#include <cstdio>
#include <map>

#include "gtest/gtest.h"
#include "tests/harness/compare.h"

namespace lightstage {
namespace {

size_t Count(const std::string& text, const std::string& what) {
  size_t count = 0;
  for (size_t at = 0; (at = text.find(what, at)) != std::string::npos; ++at) ++count;
  return count;
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
  std::map<std::string, int> pauses;  // by reason
  std::vector<std::string> capture = {"capture", "--detach"};
  capture.insert(capture.end(), plan.begin(), plan.end());
  while (Count(daemon.log(), "fault on purpose") < faults) {
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
      const std::string message = now["reason"].value("message", "");
      bool named = false;
      for (const char* device : {"camera", "turntable", "tilt", "lamps", "projector"}) {
        named |= message.find(device) != std::string::npos;
      }
      EXPECT_TRUE(named) << "names no device: " << now["reason"].dump();
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
  const std::string log = daemon.log();
  std::printf(
      "%zu faults in %d runs: %d images, %d retakes, worst difference %.3f of a code; pauses:",
      Count(log, "fault on purpose"), runs, images, retakes, worst);
  for (const auto& [reason, count] : pauses) std::printf(" %d %s", count, reason.c_str());
  std::printf("\n");
  EXPECT_EQ(daemon.Terminate(), 0);
}

}  // namespace lightstage
