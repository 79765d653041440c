// Devices that fail: retaken, or paused with the reason; never a wrong picture, never a lost shot.
#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

bool Says(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

const std::vector<std::string> kPlan = {"light-stage", "--azimuths", "3", "--lamps", "10-17"};
constexpr int kShots = 24;

// What every picture of a finished run shows, as its manifest tells it: times are in the files, so their checksums differ.
std::map<std::string, std::string> Pictures(Daemon& daemon, const std::string& run) {
  std::map<std::string, std::string> pictures;
  Json manifest = Json::parse(ReadText(daemon.RunFolder(run) / "manifest.json"));
  for (const Json& shot : manifest["shots"]) pictures[shot["file"]] = shot["checks"].dump();
  return pictures;
}

void ExpectWhole(Daemon& daemon, const std::string& run) {
  static const std::map<std::string, std::string> kWhole = [] {
    TestFolder folder;
    Daemon good(folder, SmallRig());
    return Pictures(good, good.Capture(kPlan));
  }();
  EXPECT_EQ(Pictures(daemon, run), kWhole);
  Answer verify = daemon.Ctl({"runs", "verify", run});
  EXPECT_EQ(verify.code, 0) << verify.out;
}

struct Fault {
  const char* faults;
  int least_retakes;
};

// What happens once or now and then is mended by taking the shot again.
TEST(Faults, OneThatPassesIsMended) {
  for (const Fault& fault :
       {Fault{"camera_silent_at_frame = 9", 1}, Fault{"camera_silent_at_frame = 1", 1},
        Fault{"camera_silent_at_frame = 47\ncamera_silent_frames = 2", 1},
        Fault{"camera_incomplete_every = 5", 8}, Fault{"lamps_refuse_at_set = 7", 1}}) {
    SCOPED_TRACE(fault.faults);
    TestFolder folder;
    Daemon daemon(folder, WithFaults(SmallRig(), fault.faults));
    std::string run = daemon.Capture(kPlan);
    Json done = daemon.Run(run);
    EXPECT_EQ(done["doneShots"], kShots);
    EXPECT_GE(done["retakes"].get<int>(), fault.least_retakes) << "the fault did not happen";
    ExpectWhole(daemon, run);
    Json manifest = Json::parse(ReadText(daemon.RunFolder(run) / "manifest.json"));
    int attempts = 0;
    for (const Json& shot : manifest["shots"]) attempts += shot["attempts"].get<int>();
    EXPECT_EQ(attempts - kShots, done["retakes"].get<int>());
  }
}

// A table that turns longer than the lamps stay lit by themselves: the daemon must keep them lit on the way.
TEST(Faults, LampsStayLitOverALongMove) {
  const std::vector<std::string> plan = {"light-stage", "--azimuths", "0,150.0,20", "--lamps",
                                         "12,30"};
  std::string slow = Replaced(SmallRig(), "max_velocity_dps = 720", "max_velocity_dps = 60");
  auto pictures = [&](const std::string& time_to_dark, const std::string& rig) {
    TestFolder folder;
    Daemon daemon(folder,
                  Replaced(rig, "[engine]", "[engine]\nlamp_time_to_dark_ms = " + time_to_dark));
    std::map<std::string, std::string> first = Pictures(daemon, daemon.Capture(plan));
    // From where the first one ended back to its beginning.
    EXPECT_EQ(Pictures(daemon, daemon.Capture(plan)), first);
    return first;
  };
  const auto kept = pictures("0", slow);
  EXPECT_EQ(pictures("100", slow), kept);
  EXPECT_EQ(pictures("300", RealTime(slow)), kept);
}

TEST(Faults, AProjectorThatRefusesIsAskedAgain) {
  TestFolder folder;
  Daemon daemon(folder, WithFaults(SmallRig(), "projector_refuse_at_show = 9"));
  std::string run = daemon.Capture(
      {"projector-4d", "--tilts", "1", "--azimuths", "1", "--grid", "8", "--influence", "1"});
  EXPECT_EQ(daemon.Run(run)["doneShots"], 32);
  EXPECT_GE(daemon.Run(run)["retakes"].get<int>(), 1);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
}

TEST(Faults, ACameraThatStopsAnsweringPausesTheRunWithTheReason) {
  TestFolder folder;
  // Three attempts in vain; after them it answers again.
  Daemon daemon(folder, WithFaults(SmallRig(),
                                   "camera_silent_at_frame = 11\n"
                                   "camera_silent_frames = 3"));
  Answer capture = daemon.Ctl({"capture", "light-stage", "--azimuths", "3", "--lamps", "10-17"});
  EXPECT_EQ(capture.code, 4) << capture.err;
  Json paused = capture.json()["run"];
  EXPECT_EQ(paused["state"], "RUN_STATE_PAUSED");
  ASSERT_TRUE(paused.contains("reason")) << paused;
  EXPECT_TRUE(Says(paused["reason"]["message"], "camera")) << paused["reason"];
  EXPECT_TRUE(Says(capture.err, "camera")) << capture.err;
  EXPECT_TRUE(Says(capture.err, "runs resume")) << capture.err;
  EXPECT_LT(paused["doneShots"].get<int>(), kShots);
  EXPECT_FALSE(Lit(daemon.State()));
  ASSERT_EQ(daemon.Ctl({"runs", "resume", paused["name"]}).code, 0);
  Json done = daemon.WaitForRun(paused["name"], "SUCCEEDED");
  EXPECT_EQ(done["doneShots"], kShots);
  ExpectWhole(daemon, paused["name"]);
}

TEST(Faults, ADeadCameraCostsNothingButTime) {
  TestFolder folder;
  Daemon daemon(folder, WithFaults(SmallRig(),
                                   "camera_silent_at_frame = 11\n"
                                   "camera_silent_frames = 1000000"));
  std::string run = daemon.StartRun(kPlan);
  Json paused = daemon.WaitForRun(run, "PAUSED");
  int done = paused["doneShots"];
  EXPECT_EQ(done, 5) << "frames 1 to 10 are five shots";
  ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
  EXPECT_EQ(daemon.WaitForRun(run, "PAUSED")["doneShots"], done);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  ASSERT_EQ(daemon.Ctl({"runs", "cancel", run}).code, 0);
  daemon.WaitForRun(run, "CANCELLED");
  EXPECT_EQ(daemon.Ctl({"status"}).code, 0);
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST(Faults, AnAxisThatStallsPausesTheRunAndResetMendsIt) {
  TestFolder folder;
  Daemon daemon(folder, WithFaults(SmallRig(), "axis_stall_at_move = 4"));
  std::string run = daemon.StartRun(kPlan);
  Json run_now;
  ASSERT_TRUE(WaitUntil(Milliseconds(30000), [&] {
    run_now = daemon.Run(run);
    return run_now["state"] == "RUN_STATE_PAUSED" || run_now["state"] == "RUN_STATE_SUCCEEDED";
  }));
  if (run_now["state"] == "RUN_STATE_PAUSED") {
    EXPECT_TRUE(Says(run_now["reason"]["message"], "turntable") ||
                Says(run_now["reason"]["message"], "tilt"))
        << run_now["reason"];
    EXPECT_FALSE(Lit(daemon.State()));
    ASSERT_EQ(daemon.Ctl({"reset"}).code, 0);
    ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
    daemon.WaitForRun(run, "SUCCEEDED");
  } else {
    EXPECT_GE(run_now["retakes"].get<int>(), 1) << "the fault did not happen";
  }
  ExpectWhole(daemon, run);
}

}  // namespace
}  // namespace lightstage
