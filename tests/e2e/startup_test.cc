// How the daemon starts, and when it refuses to.
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

namespace fs = std::filesystem;

bool Says(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

// Runs the daemon, which is expected to end by itself.
Answer RunDaemon(const TestFolder& folder, const std::vector<std::string>& arguments) {
  std::vector<std::string> all = {DaemonProgram()};
  all.insert(all.end(), arguments.begin(), arguments.end());
  Process process(all, folder / "lightstaged");
  Answer answer;
  answer.code = process.Wait(Milliseconds(20000));
  answer.out = process.out();
  answer.err = process.err();
  return answer;
}

TEST(Startup, TwoDaemonsNeverShareADataDirectory) {
  TestFolder folder;
  Daemon first(folder, SmallRig());
  Answer second = RunDaemon(folder, {"--rig", folder / "rig.toml", "--data", first.data(),
                                     "--listen", "unix:" + (folder / "other")});
  EXPECT_EQ(second.code, 1);
  EXPECT_TRUE(Says(second.err, std::to_string(first.process().pid()))) << second.err;
  EXPECT_TRUE(Says(second.err, first.data())) << second.err;
  first.Capture({"light-stage", "--azimuths", "2", "--lamps", "0,1"});
  // However the first one ends, the directory is free again.
  first.Kill();
  Daemon third(folder, SmallRig());
  EXPECT_EQ(third.Ctl({"runs", "list"}).json()["runs"].size(), 1u);
}

TEST(Startup, ADeadOnesSocketIsRemovedALivingOnesIsNot) {
  TestFolder folder;
  {
    Daemon dead(folder, SmallRig());
    dead.Kill();
  }
  ASSERT_TRUE(fs::exists(folder / "socket"));
  Daemon living(folder, SmallRig());
  Answer second = RunDaemon(folder, {"--rig", folder / "rig.toml", "--data", folder / "data2",
                                     "--listen", living.address()});
  EXPECT_EQ(second.code, 1);
  EXPECT_TRUE(Says(second.err, "cannot listen on " + living.address())) << second.err;
  EXPECT_EQ(living.Ctl({"status"}).code, 0) << "the refused one took the socket away";
}

TEST(Startup, WhatIsNotASocketIsLeftAlone) {
  TestFolder folder;
  WriteText(folder / "rig.toml", SmallRig());
  WriteText(folder / "precious", "data");
  Answer answer = RunDaemon(folder, {"--rig", folder / "rig.toml", "--data", folder / "data",
                                     "--listen", "unix:" + (folder / "precious")});
  EXPECT_EQ(answer.code, 1);
  EXPECT_TRUE(Says(answer.err, "precious")) << answer.err;
  EXPECT_EQ(ReadText(folder / "precious"), "data");
}

TEST(Startup, APortInUseIsSaid) {
  int fd = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(fd, 1), 0);
  socklen_t size = sizeof(address);
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  std::string where = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));

  TestFolder folder;
  WriteText(folder / "rig.toml", SmallRig());
  Answer answer = RunDaemon(
      folder, {"--rig", folder / "rig.toml", "--data", folder / "data", "--listen", where});
  EXPECT_EQ(answer.code, 1);
  EXPECT_TRUE(Says(answer.err, where)) << answer.err;
  EXPECT_TRUE(Says(answer.err, "in use")) << answer.err;
  // Free, it serves there and on a socket at once.
  close(fd);
  std::string socket_path = folder / "socket";
  Process daemon({DaemonProgram(), "--rig", folder / "rig.toml", "--data", folder / "data",
                  "--listen", where, "--listen", "unix:" + socket_path},
                 folder / "serving");
  for (const std::string& at : {where, "unix:" + socket_path}) {
    Process status({CtlProgram(), "--address", at, "--wait", "20", "status"}, folder / "status");
    EXPECT_EQ(status.Wait(), 0) << at << status.err();
  }
}

TEST(Startup, OnlyLoopbackIsServed) {
  TestFolder folder;
  WriteText(folder / "rig.toml", SmallRig());
  for (const char* address :
       {"0.0.0.0:7420", "192.0.2.1:7420", "7420", "127.0.0.1:70000", "unix:"}) {
    Answer answer = RunDaemon(
        folder, {"--rig", folder / "rig.toml", "--data", folder / "data", "--listen", address});
    EXPECT_EQ(answer.code, 1) << address;
    EXPECT_TRUE(Says(answer.err, address)) << answer.err;
  }
}

TEST(Startup, EmptyNamesAndMissingFoldersAreSaid) {
  TestFolder folder;
  WriteText(folder / "rig.toml", SmallRig());
  Answer nowhere = RunDaemon(folder, {"--rig", folder / "rig.toml", "--data", ""});
  EXPECT_EQ(nowhere.code, 2);
  EXPECT_TRUE(Says(nowhere.err, "--data")) << nowhere.err;
  Answer socket = RunDaemon(folder, {"--rig", folder / "rig.toml", "--data", folder / "data",
                                     "--listen", "unix:" + (folder / "none/socket")});
  EXPECT_EQ(socket.code, 1);
  EXPECT_TRUE(Says(socket.err, "there is no folder " + (folder / "none"))) << socket.err;
}

TEST(Startup, ARigFileFromAPipe) {
  TestFolder folder;
  ASSERT_EQ(mkfifo((folder / "rig.toml").c_str(), 0600), 0);
  Process daemon({DaemonProgram(), "--rig", folder / "rig.toml", "--check"},
                 folder / "lightstaged");
  WriteText(folder / "rig.toml", SmallRig());  // waits for the reader
  EXPECT_EQ(daemon.Wait(Milliseconds(20000)), 0) << daemon.err();
}

TEST(Startup, CheckReadsTheRigFileAndTouchesNothing) {
  TestFolder folder;
  WriteText(folder / "rig.toml", SmallRig());
  Answer good = RunDaemon(folder, {"--rig", folder / "rig.toml", "--check"});
  EXPECT_EQ(good.code, 0) << good.err;
  WriteText(folder / "rig.toml", Replaced(SmallRig(), "max_velocity_dps = 720", "max_speed = 720"));
  Answer bad = RunDaemon(folder, {"--rig", folder / "rig.toml", "--check"});
  EXPECT_NE(bad.code, 0);
  EXPECT_TRUE(Says(bad.err, "max_speed")) << bad.err;
}

TEST(Startup, CheckBuildsTheScene) {
  TestFolder folder;
  WriteText(folder / "scene.toml",
            "[material.m]\nkind = \"medium\"\nmean_free_path_m = 0.01\n"
            "[[ball]]\nradius_m = 0.05\nmaterial = \"m\"\n"
            "[[ball]]\ncenter_m = [0.09, 0, 0]\nradius_m = 0.05\nmaterial = \"m\"\n");
  WriteText(folder / "rig.toml",
            Replaced(SmallRig(), "scene = \"default\"", "scene = \"scene.toml\""));
  for (const char* how : {"--check", "--data"}) {
    std::vector<std::string> arguments = {"--rig", folder / "rig.toml", how};
    if (std::string(how) == "--data") arguments.push_back(folder / "data");
    Answer answer = RunDaemon(folder, arguments);
    EXPECT_EQ(answer.code, 1) << how;
    EXPECT_TRUE(Says(answer.err, "scene.toml: ball 0 and ball 1 overlap")) << answer.err;
  }
}

TEST(Startup, ALatencyIsMeasuredOnlyWhereThereIsOneAndNobodyUsesTheRig) {
  TestFolder folder;
  WriteText(folder / "rig.toml", SmallRig());
  const std::vector<std::string> calibrate = {"--rig", folder / "rig.toml", "--data",
                                              folder / "data", "--calibrate-latency"};
  const Answer triggered = RunDaemon(folder, calibrate);
  EXPECT_EQ(triggered.code, 1);
  EXPECT_TRUE(Says(triggered.err, "driver sim it exposes when it is triggered")) << triggered.err;
  EXPECT_EQ(triggered.out, "");
  Daemon daemon(folder, SmallRig());
  const Answer in_use = RunDaemon(folder, calibrate);
  EXPECT_EQ(in_use.code, 1);
  EXPECT_TRUE(Says(in_use.err, std::to_string(daemon.process().pid()))) << in_use.err;
  EXPECT_EQ(RunDaemon(folder, {"--rig", folder / "rig.toml", "--calibrate-latency"}).code, 2)
      << "no --data";
}

#ifndef LIGHTSTAGE_SANITIZED
// There is no room for the stack of a single one.
TEST(Startup, WantOfThreadsIsSaid) {
  TestFolder folder;
  WriteText(folder / "rig.toml", SmallRig());
  Process process({"/bin/sh", "-c", "ulimit -s 4000000 && ulimit -v 2000000 && exec \"$0\" \"$@\"",
                   DaemonProgram(), "--rig", folder / "rig.toml", "--data", folder / "data"},
                  folder / "short");
  EXPECT_EQ(process.Wait(Milliseconds(20000)), 1) << process.err();
  EXPECT_TRUE(Says(process.err(), "lightstaged: the system does not give")) << process.err();
}
#endif

TEST(Startup, ABadRigFileIsRefusedWithItsPlace) {
  TestFolder folder;
  struct Case {
    const char *from, *to;
    const char* says;
  };
  for (const Case& c : std::vector<Case>{
           {"seed = 7", "seed = 7\nsede = 8", "sede"},
           {"height = 48", "height = \"48\"", "height"},
           {"bits = 12", "bits = 99", "bits"},
           {"semicircle = 40", "tilts_deg = [-30, 10, 10, 50]", "lamp"},
           {"driver = \"sim\"\nformat", "driver = \"kodak\"\nformat", "kodak"},
           {"time = \"fast\"", "time = \"slow\"", "slow"},
           {"exposures_us = [1000, 16000]", "exposures_us = []", "exposures_us"},
           {"exposures_us = [1000, 16000]", "exposures_us = [16000, 1000]", "exposures_us"},
           {"radius_m = 1.0", "radius_m = nan", "radius_m"},
           {"[engine]", "[engine", ""},
           {"name = \"Small test rig\"", "", "name"}}) {
    std::string rig = Replaced(SmallRig(), c.from, c.to);
    WriteText(folder / "rig.toml", rig);
    // The line that was changed, or that names its table if one is missing.
    size_t at = SmallRig().find(c.from);
    std::string before = SmallRig().substr(0, at);
    int line = 1 + static_cast<int>(std::count(before.begin(), before.end(), '\n'));
    for (const char* how : {"--check", "--data"}) {
      std::vector<std::string> arguments = {"--rig", folder / "rig.toml", how};
      if (std::string(how) == "--data") arguments.push_back(folder / "data");
      Answer answer = RunDaemon(folder, arguments);
      EXPECT_EQ(answer.code, 1) << c.to;
      EXPECT_TRUE(Says(answer.err, c.says)) << answer.err;
      // "file:line:column:", where the line is at most two away: of the value, its key or its table.
      bool placed = false;
      for (int l = line - 2; l <= line + 2; ++l)
        placed |= Says(answer.err, (folder / "rig.toml") + ":" + std::to_string(l) + ":");
      EXPECT_TRUE(placed) << "wanted line " << line << ": " << answer.err;
    }
    EXPECT_FALSE(fs::exists(folder / "data")) << "the rig file comes first";
  }
  Answer missing = RunDaemon(folder, {"--rig", folder / "none.toml", "--check"});
  EXPECT_EQ(missing.code, 1);
  EXPECT_TRUE(Says(missing.err, "none.toml")) << missing.err;
  EXPECT_EQ(RunDaemon(folder, {"--rig", folder / "rig.toml"}).code, 2) << "no --data";
  EXPECT_EQ(RunDaemon(folder, {"--frobnicate"}).code, 2);
}

// A path relative to where the daemon was started says nothing to a client.
TEST(Startup, ARelativeDataDirectoryIsToldAsAWholePath) {
  TestFolder folder;
  std::string relative = fs::relative(folder / "data", fs::current_path()).string();
  WriteText(folder / "rig.toml", SmallRig());
  std::string address = "unix:" + (folder / "socket");
  Process daemon(
      {DaemonProgram(), "--rig", folder / "rig.toml", "--data", relative, "--listen", address},
      folder / "daemon");
  Process capture({CtlProgram(), "--address", address, "--wait", "20", "--format", "json",
                   "capture", "light-stage", "--azimuths", "1", "--lamps", "0", "--detach"},
                  folder / "capture");
  ASSERT_EQ(capture.Wait(), 0) << capture.err();
  fs::path directory = Json::parse(capture.out())["run"]["directory"].get<std::string>();
  EXPECT_TRUE(directory.is_absolute()) << directory;
  EXPECT_TRUE(fs::exists(directory / "run.json")) << directory;
}

TEST(Startup, ADataDirectoryThatCannotBeMadeIsSaid) {
  TestFolder folder;
  WriteText(folder / "rig.toml", SmallRig());
  WriteText(folder / "file", "");
  Answer answer = RunDaemon(folder, {"--rig", folder / "rig.toml", "--data", folder / "file/data",
                                     "--listen", "unix:" + (folder / "socket")});
  EXPECT_EQ(answer.code, 1);
  EXPECT_TRUE(Says(answer.err, "file/data")) << answer.err;
}

}  // namespace
}  // namespace lightstage
