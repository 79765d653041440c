// Runs while they run: pause, resume, cancel, watchers that come and go, and the daemon's own end.
#include <csignal>

#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

bool Says(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

// 60 shots that take a second or more.
const std::vector<std::string> kPlan = {"light-stage", "--azimuths", "4", "--lamps", "0-14"};

TEST(Lifecycle, PauseIsDarkAndResumeGoesOn) {
  TestFolder folder;
  Daemon daemon(folder, RealTime(SmallRig()));
  std::string run = daemon.StartRun(kPlan);
  daemon.WaitForShots(run, 3);
  Answer pause = daemon.Ctl({"runs", "pause", run});
  ASSERT_EQ(pause.code, 0) << pause.err;
  Json paused = daemon.WaitForRun(run, "PAUSED");
  int done = paused["doneShots"];
  EXPECT_LT(done, 60);
  Json state = daemon.State();
  EXPECT_FALSE(Lit(state));
  EXPECT_EQ(state["activity"], "RIG_ACTIVITY_RUN") << "a paused run keeps the rig";
  SleepFor(Milliseconds(200));
  EXPECT_EQ(daemon.Run(run)["doneShots"], done);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0) << "what is there is good at any time";

  Answer again = daemon.Ctl({"runs", "pause", run});
  EXPECT_EQ(again.code, 1);
  EXPECT_TRUE(Says(again.err, "RUN_STATE")) << again.err;
  Answer other = daemon.Ctl({"capture", "light-stage", "--azimuths", "2"});
  EXPECT_EQ(other.code, 1);
  EXPECT_TRUE(Says(other.err, "RUN_ACTIVE")) << other.err;
  EXPECT_EQ(daemon.Ctl({"runs", "watch", run}).code, 4) << "nothing will happen while it is paused";

  Answer resume = daemon.Ctl({"runs", "resume", run});
  ASSERT_EQ(resume.code, 0) << resume.err;
  EXPECT_EQ(resume.json()["run"]["state"], "RUN_STATE_RUNNING");
  EXPECT_EQ(daemon.Ctl({"runs", "resume", run}).code, 1);
  Answer watch = daemon.Ctl({"runs", "watch", run});
  EXPECT_EQ(watch.code, 0) << watch.err;
  EXPECT_EQ(watch.json()["run"]["state"], "RUN_STATE_SUCCEEDED");
  EXPECT_EQ(watch.json()["run"]["doneShots"], 60);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  for (const char* command : {"pause", "resume", "cancel"}) {
    Answer late = daemon.Ctl({"runs", command, run});
    EXPECT_EQ(late.code, 1) << command;
    EXPECT_TRUE(Says(late.err, "RUN_STATE")) << late.err;
  }
}

TEST(Lifecycle, CancelEndsForGoodAndKeepsWhatIsThere) {
  TestFolder folder;
  Daemon daemon(folder, RealTime(SmallRig()));
  std::string run = daemon.StartRun(kPlan);
  daemon.WaitForShots(run, 3);
  ASSERT_EQ(daemon.Ctl({"runs", "cancel", run}).code, 0);
  Json cancelled = daemon.WaitForRun(run, "CANCELLED");
  int done = cancelled["doneShots"];
  EXPECT_GE(done, 3);
  EXPECT_LT(done, 60);
  EXPECT_FALSE(Lit(daemon.State()));
  EXPECT_EQ(daemon.State()["activity"], "RIG_ACTIVITY_IDLE");
  EXPECT_EQ(daemon.Ctl({"runs", "watch", run}).code, 4);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  Answer resume = daemon.Ctl({"runs", "resume", run});
  EXPECT_EQ(resume.code, 1);
  EXPECT_TRUE(Says(resume.err, "RUN_STATE")) << resume.err;
  // A paused one can be cancelled too, and the rig is free for the next.
  std::string second = daemon.StartRun(kPlan);
  EXPECT_NE(second, run);
  ASSERT_EQ(daemon.Ctl({"runs", "pause", second}).code, 0);
  daemon.WaitForRun(second, "PAUSED");
  ASSERT_EQ(daemon.Ctl({"runs", "cancel", second}).code, 0);
  daemon.WaitForRun(second, "CANCELLED");
  daemon.Capture({"light-stage", "--azimuths", "2", "--lamps", "0,1"});
  Json runs = daemon.Ctl({"runs", "list"}).json()["runs"];
  ASSERT_EQ(runs.size(), 3u);
  EXPECT_EQ(runs[0]["state"], "RUN_STATE_SUCCEEDED");  // newest first
  EXPECT_EQ(runs[1]["name"], second);
  EXPECT_EQ(runs[2]["name"], run);
  EXPECT_EQ(runs[2]["doneShots"], done);
}

TEST(Lifecycle, AWatcherThatIsKilledOrStalledDisturbsNobody) {
  TestFolder folder;
  Daemon daemon(folder, RealTime(SmallRig()));
  auto capture = daemon.Start({"capture", "light-stage", "--azimuths", "4", "--lamps", "0-14"});
  ASSERT_TRUE(WaitUntil(Milliseconds(10000), [&] { return !capture->out().empty(); }));
  std::string run = daemon.Run("latest")["name"];
  auto stalled = daemon.Start({"runs", "watch", run, "--shots-from", "0"});
  stalled->Signal(SIGSTOP);
  capture->Signal(SIGKILL);
  capture->Wait();
  EXPECT_EQ(daemon.Run(run)["state"], "RUN_STATE_RUNNING");
  daemon.WaitForRun(run, "SUCCEEDED");
  // The one that stood still misses no shot.
  stalled->Signal(SIGCONT);
  EXPECT_EQ(stalled->Wait(), 0) << stalled->err();
  size_t shots = 0;
  std::istringstream lines(stalled->out());
  for (std::string line; std::getline(lines, line);) shots += Json::parse(line)["shots"].size();
  EXPECT_EQ(shots, 60u);
}

TEST(Lifecycle, CtrlCDetachesAndSaysHowToComeBack) {
  TestFolder folder;
  Daemon daemon(folder, RealTime(SmallRig()));
  auto capture =
      daemon.Start({"capture", "light-stage", "--azimuths", "4", "--lamps", "0-14"}, "text");
  ASSERT_TRUE(WaitUntil(Milliseconds(10000), [&] { return !capture->out().empty(); }));
  SleepFor(Milliseconds(100));
  capture->Signal(SIGINT);
  EXPECT_EQ(capture->Wait(), 130);
  std::string run = daemon.Run("latest")["name"];
  EXPECT_TRUE(Says(capture->err(), "runs watch " + run)) << capture->err();
  EXPECT_TRUE(Says(capture->err(), daemon.address())) << capture->err();
  EXPECT_EQ(daemon.Ctl({"runs", "watch", run}).code, 0);
}

TEST(Lifecycle, AToldEndInterruptsTheRunAndTheNextStartGoesOn) {
  TestFolder folder;
  std::string rig = RealTime(SmallRig()), run;
  int done = 0;
  {
    Daemon daemon(folder, rig);
    run = daemon.StartRun(kPlan);
    daemon.WaitForShots(run, 5);
    EXPECT_EQ(daemon.Terminate(), 0) << daemon.log();
    EXPECT_FALSE(std::filesystem::exists(folder / "socket"));
  }
  {
    Daemon daemon(folder, rig);
    Json interrupted = daemon.Run(run);
    EXPECT_EQ(interrupted["state"], "RUN_STATE_INTERRUPTED");
    EXPECT_EQ(interrupted["reason"]["reason"], "DAEMON_ENDED");
    done = interrupted["doneShots"];
    EXPECT_GE(done, 5);
    EXPECT_LT(done, 60);
    EXPECT_EQ(daemon.State()["activity"], "RIG_ACTIVITY_IDLE") << "nothing starts by itself";
    EXPECT_EQ(daemon.Ctl({"runs", "watch", run}).code, 4);
    EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
    // Twice interrupted, by SIGINT now.
    ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
    daemon.WaitForShots(run, done + 3);
    daemon.process().Signal(SIGINT);
    EXPECT_EQ(daemon.process().Wait(), 0);
  }
  Daemon daemon(folder, rig);
  EXPECT_GE(daemon.Run(run)["doneShots"].get<int>(), done + 3);
  ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
  EXPECT_EQ(daemon.WaitForRun(run, "SUCCEEDED")["doneShots"], 60);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  // Its terminal is closed.
  daemon.process().Signal(SIGHUP);
  EXPECT_EQ(daemon.process().Wait(), 0);
}

// On virtual time too, which stands still between runs.
TEST(Lifecycle, TimesAreInOrder) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  SleepFor(Milliseconds(1500));
  std::string name = daemon.Capture({"light-stage", "--azimuths", "1", "--lamps", "0,1"});
  Json run = daemon.Run(name);
  Json manifest = Json::parse(ReadText(daemon.RunFolder(name) / "manifest.json"));
  // RFC 3339 in UTC sorts as text, down to the second.
  std::string begin = run["createTime"], end = run["endTime"];
  EXPECT_LE(begin.substr(0, 19), end.substr(0, 19));
  for (const Json& shot : manifest["shots"]) {
    std::string taken = shot["captured_at"];
    EXPECT_LE(begin.substr(0, 19), taken.substr(0, 19));
    EXPECT_LE(taken.substr(0, 19), end.substr(0, 19));
  }
}

// A watcher rides out a restart of the daemon and tells what became of the run.
TEST(Lifecycle, AWatcherSurvivesTheDaemon) {
  TestFolder folder;
  std::string rig = RealTime(SmallRig());
  std::unique_ptr<Process> watch;
  std::string run;
  {
    Daemon daemon(folder, rig);
    run = daemon.StartRun(kPlan);
    watch = daemon.Start({"runs", "watch", run});
    ASSERT_TRUE(WaitUntil(Milliseconds(10000), [&] { return !watch->out().empty(); }));
    daemon.Kill();
  }
  Daemon daemon(folder, rig);
  EXPECT_EQ(watch->Wait(Milliseconds(30000)), 4) << watch->err();
  EXPECT_TRUE(Says(watch->out(), "RUN_STATE_INTERRUPTED")) << watch->out();
}

TEST(Lifecycle, ARunBegunWithAnotherRigFileIsNotContinued) {
  TestFolder folder;
  std::string run;
  {
    Daemon daemon(folder, RealTime(SmallRig()));
    run = daemon.StartRun(kPlan);
    daemon.WaitForShots(run, 3);
    EXPECT_EQ(daemon.Terminate(), 0);
  }
  Daemon daemon(folder, Replaced(RealTime(SmallRig()), "seed = 7", "seed = 8"));
  Answer resume = daemon.Ctl({"runs", "resume", run});
  EXPECT_EQ(resume.code, 1);
  EXPECT_TRUE(Says(resume.err, "RIG_CHANGED")) << resume.err;
  EXPECT_TRUE(Says(resume.err, "rig.toml")) << resume.err;
  EXPECT_EQ(daemon.State()["activity"], "RIG_ACTIVITY_IDLE");
}

}  // namespace
}  // namespace lightstage
