#include "daemon/store/data_directory.h"

#include <unistd.h>

#include <chrono>

#include "base/fault_env.h"
#include "base/status.h"
#include "daemon/store/room.h"
#include "daemon/store/test_run.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const WallTime kCreated = ParseUtc("2004-05-06T07:08:09.123456Z").value();

TEST(DataDirectoryTest, ASecondOneIsRefusedNamingTheFirstsProcess) {
  TemporaryDirectory temp;
  auto first = DataDirectory::Open(PosixEnv(), temp.path() + "/data");
  ASSERT_TRUE(first.ok()) << first.status();
  auto second = DataDirectory::Open(PosixEnv(), temp.path() + "/data");
  EXPECT_EQ(second.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ErrorReason(second.status()), "DATA_DIRECTORY_LOCKED");
  EXPECT_THAT(std::string(second.status().message()), HasSubstr(std::to_string(::getpid())));
  first->reset();
  EXPECT_TRUE(DataDirectory::Open(PosixEnv(), temp.path() + "/data").ok());
}

TEST(DataDirectoryTest, RunsAreNamedByTimeAndListedNewestFirst) {
  TemporaryDirectory temp;
  auto data = DataDirectory::Open(PosixEnv(), temp.path()).value();
  auto first = data->CreateRun(TestHeader(1), "rig", kCreated).value();
  auto second = data->CreateRun(TestHeader(1), "rig", kCreated).value();
  auto third = data->CreateRun(TestHeader(1), "rig", kCreated + std::chrono::seconds(1)).value();
  EXPECT_EQ(first->header().id, "20040506-070809");
  EXPECT_EQ(first->header().created_at, "2004-05-06T07:08:09.123456Z");
  EXPECT_EQ(second->header().id, "20040506-070809-2");
  // What a crash in the middle of a creation leaves is no run.
  ASSERT_TRUE(PosixEnv().CreateDirectories(temp.path() + "/runs/20040506-070811/basis").ok());
  EXPECT_THAT(data->ListRuns().value(),
              ElementsAre("20040506-070810", "20040506-070809-2", "20040506-070809"));
  EXPECT_EQ(PosixEnv().ReadFile(first->path() + "/rig.toml").value(), "rig");
}

TEST(DataDirectoryTest, HeaderComesBack) {
  TemporaryDirectory temp;
  auto data = DataDirectory::Open(PosixEnv(), temp.path()).value();
  RunHeader header = TestHeader(77);
  header.name = "";
  std::string id = data->CreateRun(header, "rig", kCreated).value()->header().id;
  auto run = data->OpenRun(id).value();
  const RunHeader& h = run->header();
  EXPECT_EQ(h.name, id);
  EXPECT_EQ(h.rig_name, header.rig_name);
  EXPECT_EQ(h.expected_shots, 77u);
  EXPECT_EQ(h.width, kTestWidth);
  EXPECT_EQ(h.channels, 3);
  EXPECT_EQ(h.compression, "piz");
  EXPECT_EQ(h.plan_json, header.plan_json);
  ASSERT_EQ(h.geometry.brace.lamps.size(), 2u);
  EXPECT_EQ(h.geometry.brace.lamps[1].azimuth, Degrees(180));
  EXPECT_EQ(h.geometry.camera.position, header.geometry.camera.position);
}

TEST(DataDirectoryTest, UnknownRunsAndNamesThatLeadElsewhere) {
  TemporaryDirectory temp;
  auto data = DataDirectory::Open(PosixEnv(), temp.path()).value();
  for (const char* id : {"", "nope", "..", "../runs", "a/b", "."}) {
    EXPECT_EQ(ErrorReason(data->OpenRun(id).status()), "RUN_NOT_FOUND") << id;
  }
}

TEST(DataDirectoryTest, ABadPlanIsRefused) {
  TemporaryDirectory temp;
  auto data = DataDirectory::Open(PosixEnv(), temp.path()).value();
  RunHeader header = TestHeader(1);
  header.plan_json = "{";
  EXPECT_EQ(data->CreateRun(header, "rig", kCreated).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(data->ListRuns().value().empty());
}

TEST(DataDirectoryTest, OpeningRemovesTemporaryFiles) {
  TemporaryDirectory temp;
  std::string path;
  {
    auto data = DataDirectory::Open(PosixEnv(), temp.path()).value();
    path = data->CreateRun(TestHeader(1), "rig", kCreated).value()->path();
  }
  for (const char* name : {"/basis/000003.exr.7.tmp", "/manifest.json.0.tmp"}) {
    ASSERT_TRUE(PosixEnv().WriteFile(path + name, "torn").ok());
  }
  auto data = DataDirectory::Open(PosixEnv(), temp.path()).value();
  EXPECT_TRUE(PosixEnv().List(path + "/basis").value().empty());
  EXPECT_FALSE(PosixEnv().Exists(path + "/manifest.json.0.tmp"));
  EXPECT_TRUE(PosixEnv().Exists(path + "/journal"));
}

TEST(DataDirectoryTest, ADamagedRunFileIsReportedAndKeepsTheOthersUsable) {
  TemporaryDirectory temp;
  auto data = DataDirectory::Open(PosixEnv(), temp.path()).value();
  auto good = data->CreateRun(TestHeader(1), "rig", kCreated).value();
  auto bad = data->CreateRun(TestHeader(1), "rig", kCreated).value();
  ASSERT_TRUE(PosixEnv().WriteFile(bad->path() + "/run.json", "{\"format\": 3}").ok());
  auto opened = data->OpenRun(bad->header().id);
  EXPECT_EQ(opened.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(opened.status().message()), HasSubstr(bad->path() + "/run.json: format"));
  EXPECT_TRUE(data->OpenRun(good->header().id).ok());
}

TEST(DataDirectoryTest, ARunExistsOnlyOnceItIsWhole) {
  for (const char* part : {"rig.toml", "journal", "run.json"}) {
    TemporaryDirectory temp;
    FaultEnv env(PosixEnv());
    auto data = DataDirectory::Open(env, temp.path()).value();
    env.Fail(EnvOp::kWriteFile, part, absl::InternalError("no"));
    EXPECT_FALSE(data->CreateRun(TestHeader(1), "rig", kCreated).ok()) << part;
    EXPECT_TRUE(data->ListRuns().value().empty()) << part;
    EXPECT_TRUE(data->CreateRun(TestHeader(1), "rig", kCreated).ok()) << part;
  }
}

TEST(DataDirectoryTest, ANewRunSurvivesAPowerCut) {
  TemporaryDirectory temp;
  FaultEnv env(PosixEnv());
  std::string id;
  {
    auto data = DataDirectory::Open(env, temp.path()).value();
    id = data->CreateRun(TestHeader(1), "rig", kCreated).value()->header().id;
  }
  ASSERT_TRUE(env.LosePower().ok());
  auto data = DataDirectory::Open(env, temp.path()).value();
  EXPECT_TRUE(data->OpenRun(id).ok());
}

TEST(RoomTest, ErrorNamesBothFigures) {
  FaultEnv env(PosixEnv());
  env.SetFreeBytes(1'500'000'000);
  EXPECT_TRUE(CheckRoom(env, "/", 1'000'000'000).ok());
  absl::Status status = CheckRoom(env, "/", 2'000'000'000);
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(ErrorReason(status), "DISK_TOO_SMALL");
  EXPECT_THAT(std::string(status.message()), HasSubstr("2.1 GB"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("1.5 GB"));
}

}  // namespace
}  // namespace lightstage
