#include "client/cpp/fetch_run.h"

#include <filesystem>

#include "base/env.h"
#include "base/fault_env.h"
#include "client/cpp/testing/fake_daemon.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage::client {
namespace {

using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

class FetchRunTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "/fetch_run_test_" +
              ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    daemon_.Change([](FakeState& s) {
      s.runs["runs/a"].set_name("runs/a");
      auto& files = s.files["runs/a"];
      files["journal"] = "not checksummed";
      files["manifest.json"] = "{}";
      files["run.json"] = "a";
      files["shots/000.exr"] = std::string(3000, 'a');
      files["shots/001.exr"] = std::string(3000, 'b');
      files["shots/002.exr"] = "";
      s.read_chunk = 1000;
    });
    auto connection = Connect(daemon_.address(), clock_, canceller_);
    ASSERT_TRUE(connection.ok()) << connection.status();
    connection_ = *std::move(connection);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  absl::StatusOr<FetchResult> Fetch() {
    FetchOptions options;
    options.patience = seconds(20);
    files_.clear();
    return FetchRun(*connection_, "runs/a", folder_, env_, std::move(options), canceller_,
                    [this](const v1::DatasetFile& file, const FetchProgress& progress) {
                      files_.push_back(file.path());
                      EXPECT_EQ(progress.done_files(), static_cast<int>(files_.size()));
                    });
  }
  std::string Local(const std::string& path) {
    auto bytes = env_.ReadFile(folder_ + "/" + path);
    return bytes.ok() ? *bytes : "(" + ErrorReason(bytes.status()) + ")";
  }
  std::vector<std::string> Read() {
    std::vector<std::string> paths;
    for (const auto& [method, request] : daemon_.Snapshot().calls) {
      if (method != "ReadFile") continue;
      v1::ReadFileRequest read;
      read.CopyFrom(*request);
      paths.push_back(read.path());
    }
    return paths;
  }

  FakeDaemon daemon_;
  RealClock clock_;
  Canceller canceller_{clock_};
  std::unique_ptr<Connection> connection_;
  FaultEnv env_{PosixEnv()};
  std::string folder_;
  std::vector<std::string> files_;
};

TEST_F(FetchRunTest, CopiesEveryFileOverPages) {
  daemon_.Change([](FakeState& s) { s.files_per_page = 2; });
  auto result = Fetch();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->progress.fetched_files, 6);
  EXPECT_EQ(result->progress.total_bytes, 6018);
  EXPECT_EQ(result->progress.done_bytes, 6018);
  EXPECT_THAT(result->problems, IsEmpty());
  EXPECT_THAT(files_, ElementsAre("run.json", "journal", "manifest.json", "shots/000.exr",
                                  "shots/001.exr", "shots/002.exr"));
  const auto files = daemon_.Snapshot().files.at("runs/a");
  for (const auto& [path, bytes] : files) {
    EXPECT_EQ(Local(path), bytes);
  }
}

TEST_F(FetchRunTest, SkipsWhatIsThereWholeAndRepairsWhatIsNot) {
  ASSERT_TRUE(Fetch().ok());
  std::string damaged(3000, 'a');
  damaged[1500] = 'A';  // the same size: only the checksum tells
  ASSERT_TRUE(env_.WriteFile(folder_ + "/shots/000.exr", damaged).ok());
  daemon_.Change([](FakeState& s) { s.calls.clear(); });
  auto result = Fetch();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->progress.skipped_files, 3);
  EXPECT_THAT(Read(), ElementsAre("run.json", "journal", "manifest.json", "shots/000.exr"));
  EXPECT_EQ(Local("shots/000.exr"), std::string(3000, 'a'));
}

TEST_F(FetchRunTest, AByteCorruptedOnTheWayIsFoundAndNotWritten) {
  daemon_.Change([](FakeState& s) { s.corrupt_file = "shots/000.exr"; });
  auto result = Fetch();
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->problems.size(), 1u);
  EXPECT_EQ(result->problems[0].path, "shots/000.exr");
  EXPECT_EQ(ErrorReason(result->problems[0].status), "CHECKSUM_MISMATCH");
  EXPECT_EQ(result->progress.bad_files, 1);
  EXPECT_EQ(Local("shots/000.exr"), "(FILE_NOT_FOUND)");
  EXPECT_EQ(Local("shots/001.exr"), std::string(3000, 'b'));  // the others are fetched all the same
}

TEST_F(FetchRunTest, GoesOnAtTheSameByteWhenTheConnectionBreaks) {
  daemon_.Change([](FakeState& s) { s.answers_before_break = 5; });  // in the middle of 000.exr
  auto result = Fetch();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->problems, IsEmpty());
  EXPECT_EQ(Local("shots/000.exr"), std::string(3000, 'a'));
  bool continued = false;
  for (const auto& [method, request] : daemon_.Snapshot().calls) {
    if (method != "ReadFile") continue;
    v1::ReadFileRequest read;
    read.CopyFrom(*request);
    continued = continued || (read.path() == "shots/000.exr" && read.offset() == 2000);
  }
  EXPECT_TRUE(continued);
}

TEST_F(FetchRunTest, AFileNamedOutsideTheFolderIsRefused) {
  for (const char* path :
       {"../evil.exr", "/etc/evil.exr", "shots/../../evil.exr", "shots//x.exr"}) {
    daemon_.Change([&](FakeState& s) { s.files["runs/a"] = {{path, "x"}}; });
    EXPECT_EQ(ErrorReason(Fetch().status()), "FILE_PATH_UNSAFE") << path;
  }
  EXPECT_THAT(Read(), IsEmpty());
}

TEST_F(FetchRunTest, AFullDiskEndsItAndLeavesNoPartOfAFile) {
  env_.FillDiskAfter(4000);
  EXPECT_EQ(ErrorReason(Fetch().status()), "DISK_FULL");
  EXPECT_EQ(Local("shots/000.exr"), std::string(3000, 'a'));
  EXPECT_EQ(Local("shots/001.exr"), "(FILE_NOT_FOUND)");
  env_.FreeDisk();
  auto result = Fetch();
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->progress.skipped_files, 2);
  EXPECT_EQ(Local("shots/001.exr"), std::string(3000, 'b'));
}

TEST_F(FetchRunTest, AFolderOfAnotherRunIsLeftAsItIs) {
  ASSERT_TRUE(Fetch().ok());
  daemon_.Change([](FakeState& s) {
    s.files["runs/a"]["run.json"] = "b";
    s.files["runs/a"]["shots/000.exr"] = "of another run";
  });
  EXPECT_EQ(ErrorReason(Fetch().status()), "FOLDER_HOLDS_ANOTHER_RUN");
  EXPECT_EQ(Local("run.json"), "a");
  EXPECT_EQ(Local("shots/000.exr"), std::string(3000, 'a'));
}

TEST_F(FetchRunTest, AFolderWithOtherFilesIsRefused) {
  std::filesystem::create_directory(folder_);
  ASSERT_TRUE(env_.WriteFile(folder_ + "/manifest.json", "mine").ok());
  absl::Status status = Fetch().status();
  EXPECT_EQ(ErrorReason(status), "FOLDER_NOT_EMPTY");
  EXPECT_EQ(Local("manifest.json"), "mine");
  // What a fetch that was killed at once left is no obstacle.
  std::filesystem::rename(folder_ + "/manifest.json", folder_ + "/run.json.0.tmp");
  EXPECT_TRUE(Fetch().ok());
}

TEST_F(FetchRunTest, SaysWhenThereIsNoSuchRun) {
  daemon_.Change([](FakeState& s) { s.files.clear(); });
  EXPECT_EQ(ErrorReason(Fetch().status()), "RUN_NOT_FOUND");
}

}  // namespace
}  // namespace lightstage::client
