// Every command from its arguments to its exit code, against a fake daemon.
#include <filesystem>
#include <functional>
#include <sstream>
#include <thread>

#include "absl/strings/str_split.h"
#include "base/env.h"
#include "client/cli/app.h"
#include "client/cpp/testing/fake_daemon.h"
#include "gmock/gmock.h"
#include "google/protobuf/util/json_util.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

// Text that commands print. Each flush of it calls `flushed`.
class Output : private std::stringbuf, public std::ostream {
 public:
  Output() : std::ostream(static_cast<std::stringbuf*>(this)) {}
  using std::stringbuf::str;
  std::function<void()> flushed = [] {};

 private:
  int sync() override { return flushed(), 0; }
};

class CommandsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "/commands_test_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    daemon_.Change([](FakeState& s) {
      s.estimate.set_shots(4);
      v1::Run& run = s.runs["runs/old"];
      run.set_name("runs/old");
      run.set_display_name("monkeys");
      run.set_state(v1::RUN_STATE_SUCCEEDED);
    });
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  // Runs a command line against the daemon and returns the exit code.
  int Run(const std::string& line) {
    out_.str("");
    err_.str("");
    std::vector<std::string> words = absl::StrSplit(line, ' ', absl::SkipEmpty());
    words.insert(words.begin(), {"--address", daemon_.address()});
    World world{out_, err_, false, false, 80, clock_, PosixEnv(), *interrupt_};
    return static_cast<int>(RunCli(words, world));
  }
  // The same with JSON asked for at the end of the line; every line of the output must be a JSON
  // object.
  std::vector<std::string> RunJson(const std::string& line, int expected_code = 0) {
    EXPECT_EQ(Run(line + " --format json"), expected_code) << err_.str();
    std::vector<std::string> lines = absl::StrSplit(out_.str(), '\n');
    EXPECT_EQ(lines.back(), "");
    lines.pop_back();
    for (const std::string& json : lines) EXPECT_TRUE(json[0] == '{' && json.back() == '}') << json;
    return lines;
  }
  template <class Message>
  Message FromJson(const std::string& json) {
    Message message;
    auto status = google::protobuf::util::JsonStringToMessage(json, &message);
    EXPECT_TRUE(status.ok()) << status.ToString() << " in " << json;
    return message;
  }
  void SetRun(const std::string& name, v1::RunState state) {
    daemon_.Change([&](FakeState& s) { s.runs[name].set_state(state); });
  }
  // Does `act` on another thread once the daemon got a call of `method`, and runs the line
  // meanwhile.
  int RunWhile(const std::string& line, const std::string& method, std::function<void()> act) {
    std::thread other([&] {
      daemon_.Eventually(
          [&](const FakeState& s) { return !s.calls.empty() && s.calls.back().first == method; });
      act();
    });
    int code = Run(line);
    other.join();
    return code;
  }

  FakeDaemon daemon_;
  RealClock clock_;
  std::unique_ptr<Canceller> interrupt_ = std::make_unique<Canceller>(clock_);
  Output out_, err_;
  std::string folder_;
};

TEST_F(CommandsTest, StatusAndRigAsTextAndAsJson) {
  daemon_.Change([](FakeState& s) {
    s.rig_state.set_activity(v1::RIG_ACTIVITY_RUN);
    s.rig_state.set_active_run("runs/x");
    s.rig.set_display_name("Lab 3");
  });
  EXPECT_EQ(Run("status"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("runs/x"));
  auto lines = RunJson("status");
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(FromJson<v1::GetRigStateResponse>(lines[0]).state().active_run(), "runs/x");
  EXPECT_EQ(Run("rig"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("Lab 3"));
  EXPECT_EQ(FromJson<v1::GetRigResponse>(RunJson("rig")[0]).rig().display_name(), "Lab 3");
  EXPECT_EQ(daemon_.Snapshot().holder, "");  // looking needs no control
}

TEST_F(CommandsTest, GlobalOptionsMayStandAnywhere) {
  EXPECT_EQ(Run("--format json status"), 0);
  std::string before = out_.str();
  EXPECT_EQ(Run("status --format json"), 0);
  EXPECT_EQ(out_.str(), before);
  EXPECT_EQ(Run("runs show old --format json"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("\"displayName\":\"monkeys\""));
  EXPECT_EQ(Run("status --format xml"), 2);
}

TEST_F(CommandsTest, StopNeedsNoControlAndResetDoes) {
  daemon_.Change([](FakeState& s) { s.holder = "bert@lab1"; });
  EXPECT_EQ(Run("stop --note smoke"), 0);
  EXPECT_EQ(daemon_.Last<v1::StopRigRequest>("StopRig").note(), "smoke");
  EXPECT_EQ(Run("reset"), 1);
  EXPECT_THAT(err_.str(), HasSubstr("bert@lab1"));
  EXPECT_THAT(err_.str(), HasSubstr("CONTROL_HELD"));
  daemon_.Change([](FakeState& s) { s.holder.clear(); });
  EXPECT_EQ(Run("reset"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("idle"));
}

TEST_F(CommandsTest, ControlIsTakenInTheUsersNameAndGivenBack) {
  EXPECT_EQ(Run("move turntable 45 --velocity-dps 3"), 0);
  auto acquired = daemon_.Last<v1::AcquireControlRequest>("AcquireControl");
  EXPECT_THAT(acquired.owner(), HasSubstr("@"));
  EXPECT_THAT(acquired.note(), HasSubstr("move turntable 45"));
  auto moved = daemon_.Last<v1::MoveAxisRequest>("MoveAxis");
  EXPECT_EQ(moved.axis(), v1::AXIS_ID_TURNTABLE);
  EXPECT_EQ(moved.target_deg(), 45);
  EXPECT_EQ(moved.velocity_dps(), 3);
  EXPECT_EQ(daemon_.Snapshot().holder, "");
  EXPECT_EQ(Run("move tilt -5.5 --owner anna --note testing"), 0);
  EXPECT_EQ(daemon_.Last<v1::MoveAxisRequest>("MoveAxis").target_deg(), -5.5);
  EXPECT_EQ(daemon_.Last<v1::AcquireControlRequest>("AcquireControl").owner(), "anna");
  EXPECT_EQ(daemon_.Last<v1::AcquireControlRequest>("AcquireControl").note(), "testing");
  EXPECT_EQ(Run("move tilt 1 --owner " + std::string(300, 'x')), 0);
  EXPECT_EQ(daemon_.Last<v1::AcquireControlRequest>("AcquireControl").owner().size(), 200u);
}

TEST_F(CommandsTest, AJogEndsInTimeOrByCtrlCAndSaysWhereItIs) {
  EXPECT_EQ(Run("jog turntable -5 --for 0.1"), 0) << err_.str();
  EXPECT_EQ(out_.str(), "at -0.5 deg\n");
  auto jogged = daemon_.Last<v1::JogAxisRequest>("JogAxis");
  EXPECT_EQ(jogged.axis(), v1::AXIS_ID_TURNTABLE);
  EXPECT_EQ(jogged.velocity_dps(), -5);
  EXPECT_EQ(jogged.seconds(), 0.1);
  daemon_.Change([](FakeState& s) {
    v1::AxisState* tilt = s.rig_state.add_axes();
    tilt->set_axis(v1::AXIS_ID_TILT);
    tilt->set_position_deg(12.5);
  });
  EXPECT_EQ(RunWhile("jog tilt 5", "JogAxis", [&] { interrupt_->Cancel(); }), 0) << err_.str();
  EXPECT_EQ(out_.str(), "at 12.5 deg\n");
  EXPECT_EQ(daemon_.Last<v1::JogAxisRequest>("JogAxis").seconds(), 3600);
  EXPECT_EQ(daemon_.Calls().back(), "ReleaseControl");
}

TEST_F(CommandsTest, BadArgumentsContactNobody) {
  for (const char* line : {"",
                           "fly",
                           "move",
                           "move tilt",
                           "move tilt nan",
                           "move roof 3",
                           "jog tilt",
                           "jog roof 3",
                           "jog tilt fast",
                           "lamps",
                           "lamps 3",
                           "lamps 3=nan",
                           "pattern",
                           "pattern round",
                           "snap",
                           "runs",
                           "runs show",
                           "runs show a/b",
                           "plan",
                           "plan light-stage --tilts 3",
                           "capture light-stage --grid 4",
                           "status --wait -1",
                           "status extra",
                           "snap --out /nonexistent/folder/f.exr"}) {
    EXPECT_EQ(Run(line), 2) << line;
    EXPECT_EQ(out_.str(), "") << line;
    EXPECT_THAT(err_.str(), HasSubstr("lightstagectl: ")) << line;
  }
  EXPECT_THAT(daemon_.Calls(), IsEmpty());
}

TEST_F(CommandsTest, HelpNamesTheExitCodes) {
  EXPECT_EQ(Run("--help"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("130  interrupted"));
  EXPECT_EQ(Run("lamps --help"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("only while somebody has control"));
}

TEST_F(CommandsTest, ADaemonThatIsNotThereIsExitCodeThree) {
  daemon_.Stop();
  EXPECT_EQ(Run("status --format json"), 3);
  EXPECT_EQ(out_.str(), "");
  EXPECT_THAT(err_.str(), HasSubstr(daemon_.address()));
}

TEST_F(CommandsTest, PlanPrintsTheEstimate) {
  EXPECT_EQ(Run("plan light-stage --lamps 0-3"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("shots            4\n"));
  EXPECT_EQ(daemon_.Last<v1::EstimateRunRequest>("EstimateRun").plan().light_stage().lamps_size(),
            4);
  EXPECT_THAT(RunJson("plan light-stage")[0], HasSubstr("\"shots\":4,\"extraShots\":0"));
  EXPECT_THAT(daemon_.Calls(), ElementsAre("EstimateRun", "EstimateRun"));
  daemon_.Change([](FakeState& s) {
    s.refuse["EstimateRun"] = FakeError(grpc::StatusCode::INVALID_ARGUMENT, "LAMP_UNKNOWN",
                                        "lamp 40 is not one of 0 to 39");
  });
  EXPECT_EQ(Run("plan light-stage --format json"), 1);
  EXPECT_EQ(out_.str(), "");
  EXPECT_EQ(err_.str(), "lightstagectl: lamp 40 is not one of 0 to 39 [LAMP_UNKNOWN]\n");
}

TEST_F(CommandsTest, CaptureHoldsControlOnlyWhileItStarts) {
  err_.flushed = [&] {                         // the first line of progress
    EXPECT_EQ(daemon_.Snapshot().holder, "");  // others may pause the run
    daemon_.Change([](FakeState& s) { s.runs["runs/r2"].set_done_shots(4); });
    SetRun("runs/r2", v1::RUN_STATE_SUCCEEDED);
  };
  EXPECT_EQ(Run("capture light-stage --name test"), 0) << err_.str();
  EXPECT_EQ(daemon_.Last<v1::StartRunRequest>("StartRun").display_name(), "test");
  EXPECT_THAT(out_.str(), HasSubstr("started runs/r2"));
  EXPECT_THAT(out_.str(), HasSubstr("4 of 4"));
  EXPECT_THAT(err_.str(), HasSubstr("  0%  0/4"));
}

TEST_F(CommandsTest, CaptureAsJsonIsOneMessageALine) {
  int code = RunWhile("capture projector-4d --format json", "WatchRun",
                      [&] { SetRun("runs/r2", v1::RUN_STATE_SUCCEEDED); });
  EXPECT_EQ(code, 0) << err_.str();
  std::vector<std::string> lines = absl::StrSplit(out_.str(), '\n', absl::SkipEmpty());
  ASSERT_GE(lines.size(), 2u);
  EXPECT_EQ(FromJson<v1::StartRunResponse>(lines.front()).run().state(), v1::RUN_STATE_RUNNING);
  EXPECT_EQ(FromJson<v1::WatchRunResponse>(lines.back()).run().state(), v1::RUN_STATE_SUCCEEDED);
}

TEST_F(CommandsTest, DetachOnlyStarts) {
  EXPECT_EQ(Run("capture light-stage --detach"), 0);
  EXPECT_THAT(err_.str(), HasSubstr("runs watch runs/r2"));
  EXPECT_THAT(daemon_.Calls(), ElementsAre("AcquireControl", "StartRun", "ReleaseControl"));
}

TEST_F(CommandsTest, CtrlCDetachesAndTheRunGoesOn) {
  int code = RunWhile("capture light-stage", "WatchRun", [&] { interrupt_->Cancel(); });
  EXPECT_EQ(code, 130);
  EXPECT_THAT(err_.str(),
              HasSubstr("lightstagectl --address " + daemon_.address() + " runs watch runs/r2"));
  EXPECT_EQ(daemon_.Snapshot().runs["runs/r2"].state(), v1::RUN_STATE_RUNNING);
}

TEST_F(CommandsTest, ARunThatPausesEndsTheWatchWithFour) {
  int code = RunWhile("capture light-stage", "WatchRun", [&] {
    daemon_.Change([](FakeState& s) {
      s.runs["runs/r2"].mutable_reason()->set_reason("DISK_FULL");
      s.runs["runs/r2"].set_state(v1::RUN_STATE_PAUSED);
    });
  });
  EXPECT_EQ(code, 4);
  EXPECT_THAT(out_.str(), HasSubstr("DISK_FULL"));
  EXPECT_THAT(err_.str(), HasSubstr("runs resume runs/r2"));
}

TEST_F(CommandsTest, ThroughPausesStays) {
  SetRun("runs/old", v1::RUN_STATE_PAUSED);
  int code = RunWhile("runs watch old --through-pauses", "WatchRun", [&] {
    SetRun("runs/old", v1::RUN_STATE_RUNNING);
    SetRun("runs/old", v1::RUN_STATE_CANCELLED);
  });
  EXPECT_EQ(code, 4);
  EXPECT_THAT(out_.str(), HasSubstr("cancelled"));
}

TEST_F(CommandsTest, ABrokenConnectionIsReportedAndMended) {
  SetRun("runs/old", v1::RUN_STATE_RUNNING);
  daemon_.Change([](FakeState& s) { s.answers_before_break = 0; });
  std::thread rig([&] {
    daemon_.Eventually([](const FakeState& s) { return s.calls.size() == 2; });
    SetRun("runs/old", v1::RUN_STATE_SUCCEEDED);
  });
  EXPECT_EQ(Run("runs watch old"), 0);
  rig.join();
  EXPECT_THAT(err_.str(), HasSubstr("connection lost"));
}

TEST_F(CommandsTest, WatchPrintsShotsOnRequest) {
  daemon_.Change([](FakeState& s) {
    for (int i = 0; i < 3; ++i) {
      v1::Shot& shot = s.shots["runs/old"].emplace_back();
      shot.set_id(i);
      shot.set_kind(v1::SHOT_KIND_BASIS);
      shot.set_file("shots/" + std::to_string(i) + ".exr");
    }
  });
  EXPECT_EQ(Run("runs watch old --shots-from 1"), 0);
  EXPECT_THAT(out_.str(), Not(HasSubstr("shot 0")));
  EXPECT_THAT(out_.str(), HasSubstr("shot 1: basis, azimuth 0 deg, tilt 0 deg, shots/1.exr\n"));
  auto lines = RunJson("runs watch old --shots-from 0");
  EXPECT_EQ(FromJson<v1::WatchRunResponse>(lines[0]).shots_size(), 3);
}

TEST_F(CommandsTest, ListJoinsAllPages) {
  daemon_.Change([](FakeState& s) {
    for (int i = 1000; i < 2500; ++i) {
      std::string name = "runs/" + std::to_string(i);
      s.runs[name].set_name(name);
    }
  });
  auto lines = RunJson("runs list");
  ASSERT_EQ(lines.size(), 1u);
  auto list = FromJson<v1::ListRunsResponse>(lines[0]);
  EXPECT_EQ(list.runs_size(), 1501);
  EXPECT_EQ(list.next_page_token(), "");
  EXPECT_EQ(Run("runs list"), 0);
  EXPECT_THAT(out_.str(), HasSubstr("runs/old   succeeded"));
}

TEST_F(CommandsTest, LatestIsTheNewestRun) {
  daemon_.Change([](FakeState& s) { s.runs["runs/p"].set_name("runs/p"); });
  EXPECT_EQ(Run("runs show latest"), 0);
  EXPECT_EQ(daemon_.Last<v1::GetRunRequest>("GetRun").name(), "runs/p");
  daemon_.Change([](FakeState& s) { s.runs.clear(); });
  EXPECT_EQ(Run("runs show latest"), 1);
  EXPECT_THAT(err_.str(), HasSubstr("RUN_NOT_FOUND"));
}

TEST_F(CommandsTest, SteeringTakesControlForOneCall) {
  SetRun("runs/old", v1::RUN_STATE_RUNNING);
  EXPECT_EQ(Run("runs pause old"), 0);
  EXPECT_EQ(out_.str(), "runs/old is paused\n");
  EXPECT_EQ(FromJson<v1::ResumeRunResponse>(RunJson("runs resume runs/old")[0]).run().state(),
            v1::RUN_STATE_RUNNING);
  EXPECT_EQ(Run("runs cancel latest"), 0);
  EXPECT_EQ(daemon_.Snapshot().runs["runs/old"].state(), v1::RUN_STATE_CANCELLED);
  EXPECT_EQ(daemon_.Snapshot().holder, "");
  daemon_.Change([](FakeState& s) { s.holder = "bert@lab1"; });
  EXPECT_EQ(Run("runs pause old"), 1);
}

TEST_F(CommandsTest, VerifyFindsDamage) {
  daemon_.Change([](FakeState& s) {
    v1::VerifyRunResponse progress;
    progress.set_total_files(2);
    progress.set_checked_files(2);
    s.verify = {progress};
  });
  EXPECT_EQ(Run("runs verify old"), 0);
  EXPECT_EQ(out_.str(), "2 files checked, no problems\n");
  daemon_.Change([](FakeState& s) {
    v1::VerifyProblem* problem = s.verify[0].add_problems();
    problem->set_file("shots/1.exr");
    problem->mutable_reason()->set_reason("CHECKSUM_MISMATCH");
    problem->mutable_reason()->set_message("differs from its record");
  });
  EXPECT_EQ(Run("runs verify old"), 5);
  EXPECT_EQ(out_.str(),
            "shots/1.exr: CHECKSUM_MISMATCH: differs from its record\n"
            "2 files checked, 1 problem\n");
  auto lines = RunJson("runs verify old", 5);
  EXPECT_EQ(FromJson<v1::VerifyRunResponse>(lines[0]).problems_size(), 1);
}

TEST_F(CommandsTest, TextThatOthersSeeIsUtf8) {
  EXPECT_EQ(Run("lamps off --note caf\xe9"), 0);
  EXPECT_EQ(daemon_.Last<v1::AcquireControlRequest>("AcquireControl").note(), "caf\ufffd");
  EXPECT_EQ(Run("capture light-stage --detach --name caf\xe9"), 2);
  EXPECT_THAT(err_.str(), HasSubstr("--name"));
}

TEST_F(CommandsTest, FetchCopiesAndReportsDamage) {
  daemon_.Change([](FakeState& s) {
    s.files["runs/old"]["run.json"] = "{}";
    s.files["runs/old"]["a.exr"] = "picture a";
    s.files["runs/old"]["b.exr"] = "picture b";
    s.corrupt_file = "b.exr";
  });
  EXPECT_EQ(Run("runs fetch old " + folder_ + "/here"), 5);
  EXPECT_EQ(*PosixEnv().ReadFile(folder_ + "/here/a.exr"), "picture a");
  EXPECT_THAT(err_.str(), HasSubstr("b.exr came with SHA-256"));
  daemon_.Change([](FakeState& s) { s.corrupt_file = ""; });
  auto lines = RunJson("runs fetch old " + folder_ + "/here");
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(FromJson<v1::DatasetFile>(lines[2]).path(), "b.exr");
  EXPECT_EQ(*PosixEnv().ReadFile(folder_ + "/here/b.exr"), "picture b");
}

TEST_F(CommandsTest, LampsGoDarkWithoutAHoldAndSaySo) {
  EXPECT_EQ(Run("lamps 3=1.0 7=0.5"), 0);
  auto request = daemon_.Last<v1::SetLampsRequest>("SetLamps");
  EXPECT_EQ(request.lamps_size(), 2);
  EXPECT_TRUE(request.others_off());
  EXPECT_EQ(out_.str(), "lamps: 3=1 7=0.5\n");
  EXPECT_THAT(err_.str(), HasSubstr("--hold"));
  EXPECT_EQ(daemon_.Calls().back(), "ReleaseControl");
  EXPECT_EQ(Run("lamps off"), 0);
  EXPECT_EQ(err_.str(), "");
  EXPECT_EQ(daemon_.Last<v1::SetLampsRequest>("SetLamps").lamps_size(), 0);
}

TEST_F(CommandsTest, AHoldKeepsControlAndEndsInTimeOrByCtrlC) {
  TimePoint start = clock_.Now();
  EXPECT_EQ(Run("lamps 3=1 --hold 0.3"), 0);
  EXPECT_GE(clock_.Now() - start, milliseconds(300));
  EXPECT_EQ(daemon_.Calls().back(), "ReleaseControl");
  // The answer is there once it is printed; a Ctrl-C before that ends the call itself.
  out_.flushed = [&] {
    EXPECT_NE(daemon_.Snapshot().holder, "");
    interrupt_->Cancel();
  };
  EXPECT_EQ(Run("pattern square column=3 row=4 --hold 600"), 0) << err_.str();
  EXPECT_EQ(out_.str(), "projector: square column 3 row 4 of grid 16, box\n");
  EXPECT_EQ(daemon_.Calls().back(), "ReleaseControl");
}

TEST_F(CommandsTest, LosingControlEndsAHoldWithAnError) {
  daemon_.Change([](FakeState& s) { s.heartbeat_seconds = 0.9; });
  int code = RunWhile("lamps 3=1 --hold 600", "SetLamps",
                      [&] { daemon_.Change([](FakeState& s) { s.token = "of another"; }); });
  EXPECT_EQ(code, 1);
  EXPECT_THAT(err_.str(), HasSubstr("CONTROL_LOST"));
}

TEST_F(CommandsTest, SnapLightsAndTakesThePictureUnderOneLease) {
  daemon_.Change([](FakeState& s) {
    s.picture = std::string(2500, 'p');
    s.read_chunk = 1000;
  });
  EXPECT_EQ(Run("snap --out " + folder_ +
                "/f.exr --lamps 0-1=0.5 --pattern square,column=2 "
                "--exposures-us 500,4000"),
            0)
      << err_.str();
  EXPECT_EQ(*PosixEnv().ReadFile(folder_ + "/f.exr"), std::string(2500, 'p'));
  EXPECT_THAT(daemon_.Calls(),
              ElementsAre("AcquireControl", "SetLamps", "ShowPattern", "Snap", "ReleaseControl"));
  EXPECT_EQ(daemon_.Last<v1::SnapRequest>("Snap").exposures_us_size(), 2);
  EXPECT_THAT(out_.str(), HasSubstr("2.4 KiB, 0 % saturated, 25 % black\n"
                                    "exposure 500 us: the camera used 0 us\n"));
  EXPECT_THAT(out_.str(), Not(HasSubstr("exposure 4000 us")));
  auto lines = RunJson("snap --out " + folder_ + "/g.exr");
  ASSERT_EQ(lines.size(), 1u);
  auto response = FromJson<v1::SnapResponse>(lines[0]);
  EXPECT_EQ(response.total_bytes(), 2500);
  EXPECT_EQ(response.data(), "");
}

TEST_F(CommandsTest, APictureThatDoesNotArriveIsAnError) {
  EXPECT_EQ(Run("snap --out " + folder_ + "/f.exr"), 1);
  EXPECT_FALSE(PosixEnv().Exists(folder_ + "/f.exr"));
}

}  // namespace
}  // namespace lightstage::client
