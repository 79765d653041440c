// Control by hand: the lease, stop and reset, and what happens to the light when a client vanishes.
#include <csignal>

#include "dataset/basis_exr.h"
#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

constexpr Milliseconds kHeartbeat{1000};  // of small.toml

bool Says(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

// A client that holds lamp 3, once it is lit.
std::unique_ptr<Process> HoldLamp(Daemon& daemon) {
  auto holder = daemon.Start(
      {"lamps", "3=1.0", "--hold", "60", "--owner", "anna@lab3", "--note", "aligning the camera"});
  EXPECT_TRUE(WaitUntil(Milliseconds(10000), [&] { return Lit(daemon.State()); })) << holder->err();
  return holder;
}

TEST(Control, ByHandEverythingDoesWhatItSays) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  Json rig = daemon.Ctl({"rig"}).json()["rig"];
  EXPECT_EQ(rig["displayName"], "Small test rig");
  EXPECT_EQ(rig["lamps"]["directions"].size(), 40u);
  EXPECT_EQ(rig["devices"].size(), 5u);
  EXPECT_EQ(rig["camera"]["width"], 64);
  EXPECT_EQ(rig["heartbeatSeconds"], 1);

  Answer move = daemon.Ctl({"move", "turntable", "45"});
  ASSERT_EQ(move.code, 0) << move.err;
  EXPECT_NEAR(move.json()["axis"]["positionDeg"].get<double>(), 45, 0.01);
  EXPECT_EQ(daemon.Ctl({"move", "tilt", "30"}).code, 0);
  Json state = daemon.State();
  EXPECT_NEAR(state["axes"][0]["positionDeg"].get<double>(), 45, 0.01);
  EXPECT_NEAR(state["axes"][1]["positionDeg"].get<double>(), 30, 0.01);
  EXPECT_EQ(state["axes"][0]["homed"], true);

  Answer lamps = daemon.Ctl({"lamps", "3=1.0", "7=0.5"});
  ASSERT_EQ(lamps.code, 0) << lamps.err;
  ASSERT_EQ(lamps.json()["lamps"].size(), 2u);
  EXPECT_EQ(lamps.json()["lamps"][0]["lamp"], 3);
  EXPECT_NEAR(lamps.json()["lamps"][1]["level"].get<double>(), 0.5, 0.01);  // of 255 steps
  EXPECT_FALSE(Lit(daemon.State())) << "control was given back, the light must be off";
  EXPECT_EQ(daemon.Ctl({"lamps", "off"}).code, 0);
  Answer pattern = daemon.Ctl({"pattern", "square", "grid=8", "column=2", "row=5"});
  ASSERT_EQ(pattern.code, 0) << pattern.err;
  EXPECT_EQ(pattern.json()["pattern"]["row"], 5);
  EXPECT_FALSE(Lit(daemon.State()));
}

TEST(Control, AJogTurnsForItsTimeOrToItsLimit) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  Answer jog = daemon.Ctl({"jog", "turntable", "-90", "--for", "8"});
  ASSERT_EQ(jog.code, 0) << jog.err;
  const double at = jog.json()["axis"]["positionDeg"].get<double>();
  EXPECT_NEAR(at, -720, 5);
  EXPECT_FALSE(jog.json()["axis"].value("moving", false));
  EXPECT_EQ(jog.json()["axis"]["homed"], true);
  EXPECT_EQ(daemon.Ctl({"move", "turntable", "45"}).code, 0);
  jog = daemon.Ctl({"jog", "turntable", "90", "--for", "1"});
  ASSERT_EQ(jog.code, 0) << jog.err;
  EXPECT_EQ(jog.json()["axis"]["homed"], true);
  EXPECT_NEAR(jog.json()["axis"]["positionDeg"].get<double>(), 45 + 90, 5);

  jog = daemon.Ctl({"jog", "tilt", "10"});
  ASSERT_EQ(jog.code, 0) << jog.err;
  EXPECT_NEAR(jog.json()["axis"]["positionDeg"].get<double>(), 90, 0.01);
  jog = daemon.Ctl({"jog", "tilt", "-10", "--for", "2"});
  ASSERT_EQ(jog.code, 0) << jog.err;
  EXPECT_NEAR(jog.json()["axis"]["positionDeg"].get<double>(), 70, 1.5);
}

TEST(Control, AJogEndsByCtrlCAndWithItsClient) {
  TestFolder folder;
  Daemon daemon(folder, RealTime(SmallRig()));
  auto moving = [&] { return daemon.State()["axes"][0]["moving"] == true; };
  auto jog = daemon.Start({"jog", "turntable", "20"});
  ASSERT_TRUE(WaitUntil(Milliseconds(10000), moving)) << jog->err();
  jog->Signal(SIGINT);
  EXPECT_EQ(jog->Wait(), 0) << jog->err();
  EXPECT_FALSE(moving());
  EXPECT_TRUE(Says(jog->out(), "positionDeg")) << jog->out();

  jog = daemon.Start({"jog", "turntable", "-20"});
  ASSERT_TRUE(WaitUntil(Milliseconds(10000), moving));
  Answer move = daemon.Ctl({"move", "turntable", "0"});
  EXPECT_TRUE(Says(move.err, "CONTROL_HELD")) << move.err;
  jog->Signal(SIGKILL);
  jog->Wait();
  EXPECT_TRUE(WaitUntil(2 * kHeartbeat, [&] { return !moving(); }));
  EXPECT_TRUE(WaitUntil(2 * kHeartbeat, [&] { return !daemon.State().contains("control"); }));

  jog = daemon.Start({"jog", "turntable", "20"});
  ASSERT_TRUE(WaitUntil(Milliseconds(10000), moving));
  ASSERT_EQ(daemon.Ctl({"stop"}).code, 0);
  EXPECT_FALSE(moving());
  EXPECT_EQ(jog->Wait(), 1);
  EXPECT_TRUE(Says(jog->err(), "stopped")) << jog->err();
}

TEST(Control, EveryAnswerHasATextForPeople) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  std::string run = daemon.Capture({"light-stage", "--azimuths", "2", "--lamps", "0,1"});
  std::string id = run.substr(run.find('/') + 1);
  struct Case {
    std::vector<std::string> arguments;
    std::string says;
  };
  for (const Case& c : std::vector<Case>{
           {{"status"}, "idle"},
           {{"rig"}, "Small test rig"},
           {{"plan", "light-stage"}, "1280"},
           {{"runs", "list"}, id},
           {{"runs", "show", "latest"}, id},
           {{"runs", "show", id}, "4"},
           {{"runs", "verify", run}, "no problem"},
           {{"runs", "fetch", run, folder / "copy"}, folder / "copy"},
           {{"runs", "watch", run}, "succeeded"},
           {{"move", "turntable", "45"}, "45"},
           {{"capture", "light-stage", "--azimuths", "1", "--lamps", "0"}, "started runs/"},
           {{"stop"}, "stop"},
           {{"reset"}, "idle"}}) {
    auto process = daemon.Start(c.arguments, "text");
    EXPECT_EQ(process->Wait(), 0) << c.arguments[0] << process->err();
    EXPECT_TRUE(Says(process->out(), c.says)) << c.arguments[0] << ": " << process->out();
    EXPECT_FALSE(Says(process->out(), "{")) << process->out();
  }
}

TEST(Control, SnapShowsTheLightThatWasAskedFor) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  auto brightness = [&](const std::vector<std::string>& light) {
    std::string file = folder / "snap.exr";
    std::vector<std::string> arguments = {"snap", "--out", file};
    arguments.insert(arguments.end(), light.begin(), light.end());
    Answer snap = daemon.Ctl(arguments);
    EXPECT_EQ(snap.code, 0) << snap.err;
    auto image = ReadBasisExr(file);
    EXPECT_TRUE(image.ok()) << image.status();
    if (!image.ok()) return 0.0;
    EXPECT_EQ(image->image.pixels.width(), 64);
    EXPECT_EQ(image->image.pixels.height(), 48);
    double sum = 0;
    for (float value : image->image.pixels.pixels()) sum += value;
    return sum;
  };
  double dark = brightness({}), half = brightness({"--lamps", "20=0.5"}),
         whole = brightness({"--lamps", "20=1.0"}), full = brightness({"--pattern", "full"});
  EXPECT_GT(whole, 10 * (dark + 1));
  EXPECT_NEAR(half / whole, 0.5, 0.05);
  EXPECT_GT(full, 10 * (dark + 1));
  EXPECT_FALSE(Lit(daemon.State()));
  EXPECT_EQ(daemon.Ctl({"snap", "--out", folder / "none/snap.exr"}).code, 2);
}

TEST(Control, BadRequestsAreRefusedWithAReason) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  struct Case {
    std::vector<std::string> arguments;
    int code;
    const char* says;
  };
  for (const Case& c : std::vector<Case>{
           {{"move", "turntable", "361"}, 1, "AZIMUTH_LIMIT"},
           {{"move", "tilt", "91"}, 1, "TILT_LIMIT"},
           {{"move", "tilt", "-1"}, 1, "TILT_LIMIT"},
           {{"move", "tilt", "nan"}, 2, "nan"},
           {{"move", "elevator", "3"}, 2, "elevator"},
           {{"move", "turntable", "3", "--velocity-dps", "-5"}, 1, "VELOCITY"},
           {{"jog", "turntable", "0"}, 1, "VELOCITY"},
           {{"jog", "turntable", "0.001"}, 1, "VELOCITY"},
           {{"jog", "turntable", "721"}, 1, "AXIS_VELOCITY"},
           {{"jog", "turntable", "10", "--for", "3601"}, 1, "JOG_TIME"},
           {{"jog", "turntable", "10", "--for", "0"}, 1, "JOG_TIME"},
           {{"jog", "turntable", "nan"}, 2, "nan"},
           {{"jog", "turntable"}, 2, "velocity"},
           {{"lamps", "40=1"}, 1, "LAMP_UNKNOWN"},
           {{"lamps", "3=1.5"}, 1, "LAMP_LEVEL"},
           {{"lamps", "3=-0.5"}, 1, "LAMP_LEVEL"},
           {{"lamps", "3"}, 2, "'3'"},
           {{"pattern", "square", "grid=8", "column=8", "row=0"}, 1, "column"},
           {{"pattern", "square", "grid=0"}, 1, "grid"},
           {{"pattern", "spiral"}, 2, "spiral"},
           {{"snap", "--out", folder / "s.exr", "--exposures-us", "4000,500"},
            1,
            "EXPOSURES_NOT_ASCENDING"},
           {{"snap", "--out", folder / "s.exr", "--lamps", "99=1"}, 1, "LAMP_UNKNOWN"},
           {{"runs", "show", "20040101-000000"}, 1, "RUN_NOT_FOUND"},
           {{"runs", "show", "latest"}, 1, "RUN_NOT_FOUND"},
           {{"runs", "show", "../../etc"}, 2, "../../etc"},
           {{"runs", "resume", "nosuchrun"}, 1, "RUN_NOT_FOUND"},
           {{"runs", "verify", "nosuchrun"}, 1, "RUN_NOT_FOUND"},
           {{"runs", "watch", "nosuchrun"}, 1, "RUN_NOT_FOUND"},
           {{"runs", "fetch", "nosuchrun", folder / "copy"}, 1, "RUN_NOT_FOUND"},
           {{"status", "--address", "unix:" + (folder / "nobody")}, 3, "nobody"},
           {{"status", "--address", "lab-seven"}, 2, "lab-seven"}}) {
    Answer answer = daemon.Ctl(c.arguments);
    EXPECT_EQ(answer.code, c.code) << c.arguments[0] << " " << c.arguments.back() << answer.err;
    EXPECT_TRUE(Says(answer.err, c.says)) << c.arguments[0] << ": " << answer.err;
    EXPECT_EQ(answer.out, "");
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "s.exr"));
  Json state = daemon.State();
  EXPECT_FALSE(Lit(state));
  EXPECT_FALSE(state.contains("control")) << state;
}

TEST(Control, ASecondClientIsToldWhoHasIt) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  auto holder = HoldLamp(daemon);
  Json state = daemon.State();  // looking needs no control
  EXPECT_EQ(state["control"]["owner"], "anna@lab3");
  EXPECT_EQ(state["control"]["note"], "aligning the camera");
  EXPECT_EQ(state["lamps"][0]["lamp"], 3);
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"move", "turntable", "10"},
        {"lamps", "off"},
        {"reset"},
        {"capture", "light-stage", "--azimuths", "2"}}) {
    Answer refused = daemon.Ctl(arguments);
    EXPECT_EQ(refused.code, 1);
    EXPECT_TRUE(Says(refused.err, "CONTROL_HELD")) << refused.err;
    EXPECT_TRUE(Says(refused.err, "anna@lab3")) << refused.err;
    EXPECT_TRUE(Says(refused.err, "aligning the camera")) << refused.err;
  }
  EXPECT_TRUE(Lit(daemon.State())) << "the refused ones changed the light";
  // The lease is kept as long as the client lives.
  SleepFor(2 * kHeartbeat);
  EXPECT_TRUE(Lit(daemon.State()));
  // Ctrl-C gives it back and ends dark.
  holder->Signal(SIGINT);
  EXPECT_EQ(holder->Wait(), 0) << holder->err();
  state = daemon.State();
  EXPECT_FALSE(Lit(state));
  EXPECT_FALSE(state.contains("control")) << state;
  EXPECT_EQ(daemon.Ctl({"move", "turntable", "10"}).code, 0);
}

TEST(Control, AClientThatVanishesLeavesNoLight) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  auto holder = HoldLamp(daemon);
  holder->Signal(SIGKILL);
  holder->Wait();
  EXPECT_TRUE(WaitUntil(2 * kHeartbeat, [&] { return !Lit(daemon.State()); }));
  Json state = daemon.State();
  EXPECT_FALSE(state.contains("control")) << state;
  EXPECT_EQ(daemon.Ctl({"move", "turntable", "10"}).code, 0);
}

// A client that hangs is as good as gone, and is told when it wakes up.
TEST(Control, AClientThatHangsLosesControl) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  auto holder = HoldLamp(daemon);
  holder->Signal(SIGSTOP);
  EXPECT_TRUE(WaitUntil(2 * kHeartbeat, [&] { return !Lit(daemon.State()); }));
  EXPECT_EQ(daemon.Ctl({"move", "turntable", "10"}).code, 0);
  holder->Signal(SIGCONT);
  EXPECT_EQ(holder->Wait(), 1);
  EXPECT_TRUE(Says(holder->err(), "CONTROL_LOST")) << holder->err();
}

TEST(Control, AVanishedClientsMotionStops) {
  TestFolder folder;
  Daemon daemon(folder,
                Replaced(RealTime(SmallRig()), "max_velocity_dps = 720", "max_velocity_dps = 20"));
  auto mover = daemon.Start({"move", "turntable", "170"});
  auto moving = [&] { return daemon.State()["axes"][0]["moving"] == true; };
  ASSERT_TRUE(WaitUntil(Milliseconds(10000), [&] {
    Json axis = daemon.State()["axes"][0];
    return axis["moving"] == true && axis["positionDeg"] > 2;
  })) << mover->err();
  mover->Signal(SIGKILL);
  mover->Wait();
  EXPECT_TRUE(WaitUntil(2 * kHeartbeat, [&] { return !moving(); }));
  EXPECT_LT(daemon.State()["axes"][0]["positionDeg"].get<double>(), 150);
  EXPECT_TRUE(WaitUntil(2 * kHeartbeat, [&] { return !daemon.State().contains("control"); }));
  EXPECT_EQ(daemon.Ctl({"move", "tilt", "10"}).code, 0);
}

TEST(Control, StopNeedsNoLeaseAndLatches) {
  TestFolder folder;
  Daemon daemon(folder, SmallRig());
  auto holder = HoldLamp(daemon);
  Answer stop = daemon.Ctl({"stop", "--note", "smoke"});
  ASSERT_EQ(stop.code, 0) << stop.err;
  EXPECT_EQ(stop.json()["state"]["activity"], "RIG_ACTIVITY_STOPPED");
  EXPECT_FALSE(Lit(stop.json()["state"])) << "stop answers when all is dark";
  EXPECT_TRUE(Says(stop.json()["state"]["stopReason"]["message"], "smoke"));
  holder->Signal(SIGINT);
  holder->Wait();

  Answer again = daemon.Ctl({"stop"});  // in every state
  EXPECT_EQ(again.code, 0) << again.err;
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"move", "turntable", "10"},
        {"jog", "turntable", "10"},
        {"lamps", "3=1"},
        {"pattern", "full"},
        {"capture", "light-stage", "--azimuths", "2"}}) {
    Answer refused = daemon.Ctl(arguments);
    EXPECT_EQ(refused.code, 1) << arguments[0];
    EXPECT_TRUE(Says(refused.err, "RIG_STOPPED")) << refused.err;
  }
  EXPECT_FALSE(Lit(daemon.State()));
  // A plan is only counted: it works in every state.
  EXPECT_EQ(daemon.Ctl({"plan", "light-stage"}).code, 0);

  Answer reset = daemon.Ctl({"reset"});
  ASSERT_EQ(reset.code, 0) << reset.err;
  EXPECT_EQ(reset.json()["state"]["activity"], "RIG_ACTIVITY_IDLE");
  EXPECT_FALSE(reset.json()["state"].contains("stopReason"));
  EXPECT_EQ(reset.json()["state"]["axes"][0]["homed"], true);
  EXPECT_EQ(daemon.Ctl({"move", "turntable", "10"}).code, 0);
}

TEST(Control, StopDuringARunPausesItDarkUntilReset) {
  TestFolder folder;
  Daemon daemon(folder, RealTime(SmallRig()));
  std::string run = daemon.StartRun({"light-stage", "--azimuths", "4", "--lamps", "0-14"});
  daemon.WaitForShots(run, 5);
  Answer stop = daemon.Ctl({"stop"});
  ASSERT_EQ(stop.code, 0) << stop.err;
  EXPECT_FALSE(Lit(stop.json()["state"]));
  EXPECT_EQ(stop.json()["state"]["activity"], "RIG_ACTIVITY_STOPPED");
  Json paused = daemon.WaitForRun(run, "PAUSED");
  EXPECT_LT(paused["doneShots"].get<int>(), 60);
  EXPECT_EQ(paused["reason"]["reason"], "STOP_ASKED") << paused;

  Answer resume = daemon.Ctl({"runs", "resume", run});
  EXPECT_EQ(resume.code, 1);
  EXPECT_TRUE(Says(resume.err, "RIG_STOPPED")) << resume.err;
  SleepFor(Milliseconds(200));
  EXPECT_EQ(daemon.Run(run)["state"], "RUN_STATE_PAUSED");
  EXPECT_FALSE(Lit(daemon.State()));

  ASSERT_EQ(daemon.Ctl({"reset"}).code, 0);
  EXPECT_EQ(daemon.Run(run)["state"], "RUN_STATE_PAUSED") << "a reset must not start anything";
  ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
  Json done = daemon.WaitForRun(run, "SUCCEEDED");
  EXPECT_EQ(done["doneShots"], 60);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
}

TEST(Control, NothingMovesByHandDuringARun) {
  TestFolder folder;
  Daemon daemon(folder, RealTime(SmallRig()));
  std::string run = daemon.StartRun({"light-stage", "--azimuths", "4", "--lamps", "0-14"});
  EXPECT_EQ(daemon.State()["activity"], "RIG_ACTIVITY_RUN");
  EXPECT_EQ(daemon.State()["activeRun"], run);
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"move", "turntable", "10"},
        {"lamps", "3=1"},
        {"lamps", "off"},
        {"pattern", "full"},
        {"snap", "--out", folder / "s.exr"},
        {"reset"},
        {"capture", "light-stage", "--azimuths", "2"}}) {
    Answer refused = daemon.Ctl(arguments);
    EXPECT_EQ(refused.code, 1) << arguments[0];
    EXPECT_TRUE(Says(refused.err, "RUN_ACTIVE")) << refused.err;
  }
  Json done = daemon.WaitForRun(run, "SUCCEEDED");
  EXPECT_EQ(done["retakes"], 0) << "what was refused disturbed the run";
}

}  // namespace
}  // namespace lightstage
