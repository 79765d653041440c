#include "base/env.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <thread>

#include "base/failpoint.h"
#include "base/fault_env.h"
#include "base/status.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class EnvTest : public ::testing::TestWithParam<bool> {
 protected:
  EnvTest() : env_(MakePosixEnv({.direct_io = GetParam()})) {
    dir_ = ::testing::TempDir() + "lightstage_env_XXXXXX";
    EXPECT_NE(::mkdtemp(dir_.data()), nullptr);
  }
  ~EnvTest() override { std::filesystem::remove_all(dir_); }
  std::string Path(const std::string& name) const { return dir_ + "/" + name; }

  std::unique_ptr<Env> env_;
  std::string dir_;
};

INSTANTIATE_TEST_SUITE_P(Io, EnvTest, ::testing::Bool(),
                         [](const auto& info) { return info.param ? "Direct" : "Cached"; });

std::string Bytes(size_t size) {
  std::string bytes(size, '\0');
  uint32_t x = 1;
  for (char& c : bytes) c = static_cast<char>((x = x * 1664525u + 1013904223u) >> 24);
  return bytes;
}

TEST_P(EnvTest, FilesComeBackAtEverySizeAroundTheBlocks) {
  for (size_t size :
       {0u, 1u, 4095u, 4096u, 4097u, 100001u, (4u << 20) - 1, 4u << 20, (4u << 20) + 1}) {
    std::string bytes = Bytes(size);
    ASSERT_TRUE(env_->WriteFile(Path("f"), bytes).ok());
    auto read = env_->ReadFile(Path("f"));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_TRUE(*read == bytes) << size;
    EXPECT_EQ(env_->FileSize(Path("f")).value(), size);
  }
  EXPECT_THAT(env_->List(dir_).value(), ElementsAre("f"));  // no temporary left behind
}

TEST_P(EnvTest, ReadRange) {
  ASSERT_TRUE(env_->WriteFile(Path("f"), "0123456789").ok());
  EXPECT_EQ(env_->ReadRange(Path("f"), 3, 4).value(), "3456");
  EXPECT_EQ(env_->ReadRange(Path("f"), 8, 40).value(), "89");
  EXPECT_EQ(env_->ReadRange(Path("f"), 40, 4).value(), "");
}

TEST_P(EnvTest, FilesThatNoMemoryHoldsAreRefused) {
  ASSERT_TRUE(env_->WriteFile(Path("f"), "0123456789").ok());
  std::filesystem::resize_file(Path("f"), uint64_t{1} << 40);  // no block more on the disk
  EXPECT_EQ(env_->ReadRange(Path("f"), 3, 4).value(), "3456");
  for (const absl::Status& status :
       {env_->ReadFile(Path("f")).status(), env_->ReadInput(Path("f")).status(),
        ReadNamedFile(Path("f"), *env_).status()}) {
    EXPECT_EQ(ErrorReason(status), "FILE_TOO_LARGE") << status;
    EXPECT_THAT(status.message(), testing::HasSubstr(Path("f"))) << status;
  }
  std::filesystem::resize_file(Path("f"), kLargestInput + 1);
  EXPECT_EQ(ErrorReason(ReadNamedFile(Path("f"), *env_).status()), "FILE_TOO_LARGE");
}

TEST_P(EnvTest, ParallelWritersOfOnePathLeaveOneWholeFile) {
  std::vector<std::thread> threads;
  for (char c : {'a', 'b', 'c'}) {
    threads.emplace_back([&, c] {
      for (int i = 0; i < 5; ++i)
        EXPECT_TRUE(env_->WriteFile(Path("f"), std::string(10000, c)).ok());
    });
  }
  for (auto& t : threads) t.join();
  std::string read = env_->ReadFile(Path("f")).value();
  EXPECT_EQ(read, std::string(10000, read[0]));
  EXPECT_THAT(env_->List(dir_).value(), ElementsAre("f"));
}

TEST_P(EnvTest, ErrorsNameOperationAndPath) {
  auto read = env_->ReadFile(Path("nothing"));
  EXPECT_EQ(read.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(read.status().message()), HasSubstr(Path("nothing")));
  EXPECT_EQ(env_->WriteFile(Path("no/folder"), Bytes(5000)).code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(env_->List(Path("nothing")).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(env_->Remove(Path("nothing")).code(), absl::StatusCode::kNotFound);
  EXPECT_FALSE(env_->ReadFile(dir_).ok());
}

TEST_P(EnvTest, FailedWriteLeavesTheOldFileAndNoTemporary) {
  ASSERT_TRUE(env_->WriteFile(Path("a"), "old").ok());
  ASSERT_TRUE(SetFailpoints("env.before_rename=error:1").ok());
  EXPECT_FALSE(env_->WriteFile(Path("a"), Bytes(5000)).ok());
  ASSERT_TRUE(SetFailpoints("").ok());
  EXPECT_EQ(env_->ReadFile(Path("a")).value(), "old");
  EXPECT_THAT(env_->List(dir_).value(), ElementsAre("a"));
}

TEST_P(EnvTest, WritesThroughLinksAndOverNothingThatIsNoFile) {
  ASSERT_TRUE(env_->WriteFile(Path("real"), "old").ok());
  std::filesystem::create_symlink("real", Path("link"));
  ASSERT_TRUE(env_->WriteFile(Path("link"), Bytes(5000)).ok());
  EXPECT_TRUE(std::filesystem::is_symlink(Path("link")));
  EXPECT_EQ(env_->ReadFile(Path("real")).value(), Bytes(5000));

  std::filesystem::create_directory(Path("folder"));
  EXPECT_FALSE(env_->WriteFile(Path("folder"), "x").ok());
  ASSERT_EQ(::mkfifo(Path("pipe").c_str(), 0600), 0);
  absl::Status refused = env_->WriteFile(Path("pipe"), "x");
  EXPECT_EQ(ErrorReason(refused), "FILE_NOT_REGULAR");
  EXPECT_THAT(std::string(refused.message()), HasSubstr(Path("pipe")));
  EXPECT_TRUE(std::filesystem::is_fifo(Path("pipe")));
}

TEST_P(EnvTest, ReadsAPipeToItsEnd) {
  ASSERT_EQ(::mkfifo(Path("pipe").c_str(), 0600), 0);
  EXPECT_EQ(ErrorReason(env_->ReadFile(Path("pipe")).status()), "FILE_NOT_REGULAR");
  std::thread writer([&] {
    int fd = ::open(Path("pipe").c_str(), O_WRONLY);
    std::string bytes = Bytes(200000);
    for (size_t done = 0; done < bytes.size();) {
      ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
      if (n < 0) break;
      done += static_cast<size_t>(n);
    }
    ::close(fd);
  });
  auto read = env_->ReadInput(Path("pipe"));
  writer.join();
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_TRUE(*read == Bytes(200000));
}

TEST_P(EnvTest, AnAppendedFileThatWasReplacedIsNoticed) {
  auto file = env_->OpenAppend(Path("j")).value();
  ASSERT_TRUE(file->Append("one\n").ok());
  ASSERT_TRUE(file->Sync().ok());
  ASSERT_TRUE(env_->WriteFile(Path("j"), "another").ok());
  ASSERT_TRUE(file->Append("two\n").ok());
  EXPECT_EQ(ErrorReason(file->Sync()), "FILE_REPLACED");
  ASSERT_TRUE(env_->Remove(Path("j")).ok());
  EXPECT_EQ(file->Sync().code(), absl::StatusCode::kNotFound);
}

TEST_P(EnvTest, AppendAndTruncate) {
  {
    auto file = env_->OpenAppend(Path("j")).value();
    EXPECT_TRUE(file->Append("one\n").ok());
    EXPECT_TRUE(file->Append("two\n").ok());
    EXPECT_TRUE(file->Sync().ok());
  }
  EXPECT_TRUE(env_->Truncate(Path("j"), 4).ok());
  auto file = env_->OpenAppend(Path("j")).value();
  EXPECT_TRUE(file->Append("three\n").ok());
  EXPECT_EQ(env_->ReadFile(Path("j")).value(), "one\nthree\n");
  EXPECT_TRUE(env_->SyncDirectory(dir_).ok());
  EXPECT_GT(env_->FreeBytes(dir_).value(), 0u);
}

TEST_P(EnvTest, LockNamesItsHolder) {
  auto lock = env_->Lock(Path("lock"));
  ASSERT_TRUE(lock.ok());
  auto second = env_->Lock(Path("lock"));
  EXPECT_EQ(second.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ErrorReason(second.status()), "FILE_LOCKED");
  EXPECT_THAT(std::string(second.status().message()), HasSubstr(std::to_string(::getpid())));
  lock->reset();
  EXPECT_TRUE(env_->Lock(Path("lock")).ok());
}

class FaultEnvTest : public EnvTest {
 protected:
  FaultEnv fault_{*env_};
};

INSTANTIATE_TEST_SUITE_P(Io, FaultEnvTest, ::testing::Values(true));

TEST_P(FaultEnvTest, DiskFillsAndRecovers) {
  fault_.FillDiskAfter(150);
  EXPECT_TRUE(fault_.WriteFile(Path("a"), Bytes(100)).ok());
  absl::Status full = fault_.WriteFile(Path("b"), Bytes(100));
  EXPECT_EQ(full.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(ErrorReason(full), "DISK_FULL");
  EXPECT_FALSE(fault_.Exists(Path("b")));
  auto journal = fault_.OpenAppend(Path("j")).value();
  EXPECT_EQ(ErrorReason(journal->Append("x")), "DISK_FULL");
  fault_.FreeDisk();
  EXPECT_TRUE(journal->Append("x").ok());
  EXPECT_TRUE(fault_.WriteFile(Path("b"), Bytes(100)).ok());
}

TEST_P(FaultEnvTest, AppendOnAFullDiskIsTorn) {
  auto journal = fault_.OpenAppend(Path("j")).value();
  fault_.FillDiskAfter(3);
  EXPECT_FALSE(journal->Append("abcdef").ok());
  EXPECT_EQ(fault_.ReadFile(Path("j")).value(), "abc");
}

TEST_P(FaultEnvTest, FailsTheNamedOperationOnTheNamedPathSoManyTimes) {
  fault_.Fail(EnvOp::kWriteFile, "basis/", ErrnoError(EIO, "write", "x"), 2);
  EXPECT_TRUE(fault_.WriteFile(Path("a"), "x").ok());
  ASSERT_TRUE(fault_.CreateDirectories(Path("basis")).ok());
  EXPECT_FALSE(fault_.WriteFile(Path("basis/a"), "x").ok());
  EXPECT_FALSE(fault_.WriteFile(Path("basis/b"), "x").ok());
  EXPECT_TRUE(fault_.WriteFile(Path("basis/c"), "x").ok());
}

TEST_P(FaultEnvTest, PowerCutLosesWhatWasNotSynced) {
  ASSERT_TRUE(fault_.WriteFile(Path("kept"), "x").ok());
  {
    auto journal = fault_.OpenAppend(Path("j")).value();
    ASSERT_TRUE(fault_.SyncDirectory(dir_).ok());
    ASSERT_TRUE(journal->Append("synced\n").ok());
    ASSERT_TRUE(journal->Sync().ok());
    ASSERT_TRUE(journal->Append("lost\n").ok());
  }
  ASSERT_TRUE(fault_.WriteFile(Path("lost"), "x").ok());
  ASSERT_TRUE(fault_.LosePower().ok());
  EXPECT_THAT(env_->List(dir_).value(), ElementsAre("j", "kept"));
  EXPECT_EQ(env_->ReadFile(Path("j")).value(), "synced\n");
}

TEST_P(FaultEnvTest, FreeBytesCanBeSet) {
  fault_.SetFreeBytes(123);
  EXPECT_EQ(fault_.FreeBytes(dir_).value(), 123u);
  fault_.SetFreeBytes({});
  EXPECT_GT(fault_.FreeBytes(dir_).value(), 123u);
}

}  // namespace
}  // namespace lightstage
