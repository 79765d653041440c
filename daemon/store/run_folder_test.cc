#include "daemon/store/run_folder.h"

#include "base/fault_env.h"
#include "base/status.h"
#include "daemon/store/journal.h"
#include "daemon/store/test_run.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const WallTime kNow = ParseUtc("2004-05-06T07:08:09Z").value();

class RunFolderTest : public ::testing::Test {
 protected:
  RunFolderTest() { Create(); }

  void Create() {
    auto data = DataDirectory::Open(env_, temp_.path()).value();
    run_ = data->CreateRun(TestHeader(20), "rig", kNow).value();
  }
  void Reopen() {
    std::string path = run_->path();
    run_.reset();
    auto opened = RunFolder::Open(env_, path);
    ASSERT_TRUE(opened.ok()) << opened.status();
    run_ = *std::move(opened);
  }
  std::string Path(const std::string& name) const { return run_->path() + "/" + name; }

  static ShotRecord Record(uint64_t id) {
    ShotRecord record;
    record.shot = TestShot(id).shot;
    record.file = RunFolder::ImageFile(record.shot.kind, id);
    record.bytes = 100;
    record.captured_at = "2004-05-06T07:08:09Z";
    return record;
  }
  static std::vector<uint64_t> Ids(const std::vector<ShotRecord>& records) {
    std::vector<uint64_t> ids;
    for (const ShotRecord& record : records) ids.push_back(record.shot.id);
    return ids;
  }

  TemporaryDirectory temp_;
  FaultEnv env_{PosixEnv()};
  std::unique_ptr<RunFolder> run_;
};

TEST_F(RunFolderTest, RecordsAndTotalsSurviveReopening) {
  ShotRecord three = Record(3);
  three.attempts = 3;
  three.checks.nothing_seen = true;
  ASSERT_TRUE(run_->AppendRecords({Record(1), three}).ok());
  ASSERT_TRUE(run_->AppendRecords({Record(9), Record(2)}).ok());
  for (int round = 0; round < 2; ++round) {
    EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1, 3, 9, 2));  // as they became durable
    EXPECT_THAT(Ids(run_->Records(1, 2)), ElementsAre(3, 9));
    EXPECT_THAT(run_->Records(4, 10), IsEmpty());
    EXPECT_TRUE(run_->HasRecord(9));
    EXPECT_FALSE(run_->HasRecord(4));
    EXPECT_EQ(run_->Find(2)->file, "basis/000002.exr");
    EXPECT_EQ(run_->Find(9)->file, "reference/000009.exr");
    EXPECT_EQ(ErrorReason(run_->Find(5).status()), "SHOT_NOT_DONE");
    EXPECT_EQ(run_->LastReference()->shot.id, 9u);
    RunTotals totals = run_->totals();
    EXPECT_EQ(totals.records, 4u);
    EXPECT_EQ(totals.bytes, 400u);
    EXPECT_EQ(totals.retakes, 2u);
    EXPECT_EQ(totals.nothing_seen, 1u);
    Reopen();
  }
}

TEST_F(RunFolderTest, StatesSurviveWithTheirReason) {
  absl::Status reason = Error(absl::StatusCode::kResourceExhausted, "DISK_FULL",
                              "no room \xff here", {{"path", "/data"}});
  ASSERT_TRUE(run_->AppendState(RunState::kRunning, absl::OkStatus(), kNow).ok());
  ASSERT_TRUE(run_->AppendState(RunState::kFailed, reason, kNow).ok());
  Reopen();
  EXPECT_EQ(run_->state().state, RunState::kFailed);
  EXPECT_EQ(run_->state().at, "2004-05-06T07:08:09.000000Z");
  absl::Status read = run_->state().reason;
  EXPECT_EQ(read.code(), reason.code());
  EXPECT_EQ(ErrorReason(read), "DISK_FULL");
  EXPECT_THAT(std::string(read.message()), HasSubstr("no room"));
  EXPECT_EQ(ErrorMetadataOf(read), ErrorMetadataOf(reason));
}

TEST_F(RunFolderTest, ARunWithoutAFinalStateReadsAsInterrupted) {
  for (RunState state :
       {RunState::kRunning, RunState::kPaused, RunState::kPausing, RunState::kCancelling}) {
    ASSERT_TRUE(run_->PrepareToAppend().ok());
    ASSERT_TRUE(run_->AppendState(state, absl::OkStatus(), kNow).ok());
    Reopen();
    EXPECT_EQ(run_->state().state, RunState::kInterrupted);
    EXPECT_THAT(std::string(run_->state().reason.message()),
                HasSubstr(std::string(RunStateName(state))));
  }
  ASSERT_TRUE(run_->PrepareToAppend().ok());
  ASSERT_TRUE(run_->AppendState(RunState::kSucceeded, absl::OkStatus(), kNow).ok());
  Reopen();
  EXPECT_EQ(run_->state().state, RunState::kSucceeded);
  EXPECT_TRUE(run_->state().reason.ok());
}

TEST_F(RunFolderTest, NothingIsAppendedBeforePreparation) {
  Reopen();
  EXPECT_EQ(ErrorReason(run_->AppendRecords({Record(1)})), "RUN_READ_ONLY");
  EXPECT_FALSE(run_->appending());
}

TEST_F(RunFolderTest, AShotIsRecordedOnce) {
  ASSERT_TRUE(run_->AppendRecords({Record(1)}).ok());
  EXPECT_EQ(ErrorReason(run_->AppendRecords({Record(2), Record(1)})), "SHOT_DUPLICATE");
  EXPECT_EQ(ErrorReason(run_->AppendRecords({Record(3), Record(3)})), "SHOT_DUPLICATE");
  Reopen();
  EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1));
}

TEST_F(RunFolderTest, ATornTailIsCutOnlyWhenTheRunGoesOn) {
  ASSERT_TRUE(run_->AppendRecords({Record(1), Record(2)}).ok());
  uint64_t size = env_.FileSize(Path("journal")).value();
  ASSERT_TRUE(env_.Truncate(Path("journal"), size - 7).ok());
  Reopen();
  EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1));
  EXPECT_GT(run_->torn_bytes(), 0u);
  EXPECT_EQ(env_.FileSize(Path("journal")).value(), size - 7);  // looking changes nothing
  ASSERT_TRUE(run_->PrepareToAppend().ok());
  ASSERT_TRUE(run_->AppendRecords({Record(2)}).ok());
  Reopen();
  EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1, 2));
  EXPECT_TRUE(run_->damage().ok());
  EXPECT_EQ(env_.FileSize(Path("journal")).value(), size);
}

TEST_F(RunFolderTest, ADamagedJournalStillLoadsButIsNotContinued) {
  ASSERT_TRUE(run_->AppendRecords({Record(1)}).ok());
  uint64_t before = env_.FileSize(Path("journal")).value();
  ASSERT_TRUE(run_->AppendRecords({Record(2), Record(3)}).ok());
  FlipBit(Path("journal"), before + 30);
  Reopen();
  EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1, 3));
  EXPECT_EQ(run_->damage().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(run_->damage().message()),
              HasSubstr(Path("journal") + ": line 3 at byte " + std::to_string(before)));
  EXPECT_EQ(ErrorReason(run_->PrepareToAppend()), "JOURNAL_CORRUPT");
}

TEST_F(RunFolderTest, RecordsWhoseImageIsGoneOrCutAreGivenUp) {
  ASSERT_TRUE(run_->AppendRecords({Record(1), Record(9), Record(2), Record(3)}).ok());
  ASSERT_TRUE(env_.WriteFile(Path("basis/000001.exr"), std::string(100, 'x')).ok());
  ASSERT_TRUE(env_.WriteFile(Path("basis/000003.exr"), std::string(99, 'x')).ok());
  Reopen();
  ASSERT_TRUE(run_->PrepareToAppend().ok());
  ASSERT_TRUE(run_->RetractLost().ok());
  for (int round = 0; round < 2; ++round) {
    EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1));
    EXPECT_FALSE(run_->HasRecord(2));
    EXPECT_FALSE(run_->LastReference().has_value());
    EXPECT_EQ(run_->totals().bytes, 100u);
    EXPECT_TRUE(run_->damage().ok());
    Reopen();
  }
  // They can be taken again, and count once.
  ASSERT_TRUE(run_->PrepareToAppend().ok());
  ASSERT_TRUE(run_->AppendRecords({Record(2)}).ok());
  Reopen();
  EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1, 2));
}

TEST_F(RunFolderTest, GivingUpWhatHasNoRecordIsDamage) {
  std::string journal = env_.ReadFile(Path("journal")).value();
  ASSERT_TRUE(
      env_.WriteFile(Path("journal"), journal + JournalLine(R"({"type":"lost","shots":[7]})"))
          .ok());
  Reopen();
  EXPECT_THAT(std::string(run_->damage().message()), HasSubstr("names 7, which has no record"));
}

TEST_F(RunFolderTest, AnotherRunsJournalIsRefused) {
  ASSERT_TRUE(env_.WriteFile(Path("journal"),
                             JournalLine(R"({"type":"journal","version":1,"run":"other"})"))
                  .ok());
  Reopen();
  EXPECT_THAT(std::string(run_->damage().message()), HasSubstr("'other'"));
}

TEST_F(RunFolderTest, AnEmptyJournalIsDamage) {
  ASSERT_TRUE(env_.WriteFile(Path("journal"), "").ok());
  Reopen();
  EXPECT_EQ(ErrorReason(run_->damage()), "JOURNAL_CORRUPT");
}

TEST_F(RunFolderTest, AFullDiskTearsNothing) {
  ASSERT_TRUE(run_->AppendRecords({Record(1)}).ok());
  env_.FillDiskAfter(10);
  EXPECT_EQ(ErrorReason(run_->AppendRecords({Record(2), Record(3)})), "DISK_FULL");
  EXPECT_FALSE(run_->HasRecord(2));
  env_.FreeDisk();
  ASSERT_TRUE(run_->AppendRecords({Record(3)}).ok());
  Reopen();
  EXPECT_TRUE(run_->damage().ok());
  EXPECT_EQ(run_->torn_bytes(), 0u);
  EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1, 3));
}

TEST_F(RunFolderTest, AFailedSyncIsTakenBackEvenIfThatHasToWait) {
  ASSERT_TRUE(run_->AppendRecords({Record(1)}).ok());
  env_.Fail(EnvOp::kSync, "journal", absl::InternalError("io"));
  env_.Fail(EnvOp::kTruncate, "journal", absl::InternalError("io"));
  EXPECT_FALSE(run_->AppendRecords({Record(2)}).ok());
  ASSERT_TRUE(run_->AppendRecords({Record(3)}).ok());
  Reopen();
  EXPECT_THAT(Ids(run_->Records(0, 100)), ElementsAre(1, 3));
}

TEST_F(RunFolderTest, FilesWithoutRecordAreRemovedWhenTheRunGoesOn) {
  ASSERT_TRUE(run_->AppendRecords({Record(1)}).ok());
  for (const char* name :
       {"basis/000001.exr", "basis/000002.exr", "dark/000008.exr", "basis/000003.exr.1.tmp"}) {
    ASSERT_TRUE(env_.WriteFile(Path(name), "x").ok());
  }
  Reopen();
  ASSERT_TRUE(run_->PrepareToAppend().ok());
  EXPECT_THAT(env_.List(Path("basis")).value(), ElementsAre("000001.exr"));
  EXPECT_THAT(env_.List(Path("dark")).value(), IsEmpty());
}

TEST_F(RunFolderTest, PathsStayInside) {
  EXPECT_EQ(run_->PathOf("basis/000001.exr").value(), Path("basis/000001.exr"));
  for (const char* bad : {"", "/etc/passwd", "../other/journal", "basis/../../x", "./run.json"}) {
    EXPECT_EQ(ErrorReason(run_->PathOf(bad).status()), "FILE_NAME") << bad;
  }
}

TEST_F(RunFolderTest, ListsFilesWithSizes) {
  ASSERT_TRUE(env_.WriteFile(Path("basis/000001.exr"), "12345").ok());
  ASSERT_TRUE(env_.WriteFile(Path("basis/000002.exr.1.tmp"), "1").ok());
  std::vector<std::string> names;
  std::vector<FolderFile> files = run_->ListFiles().value();
  for (const FolderFile& file : files) names.push_back(file.path);
  EXPECT_THAT(names, ElementsAre("basis/000001.exr", "journal", "rig.toml", "run.json"));
  EXPECT_EQ(files[0].bytes, 5u);
}

TEST_F(RunFolderTest, LoadsALongRun) {
  constexpr uint64_t kShots = 5000;
  std::vector<ShotRecord> batch;
  for (uint64_t id = 0; id < kShots; ++id) {
    batch.push_back(Record(id));
    if (batch.size() == 500) {
      ASSERT_TRUE(run_->AppendRecords(batch).ok());
      batch.clear();
    }
  }
  Reopen();
  EXPECT_EQ(run_->count(), kShots);
  for (uint64_t id = 0; id < kShots; ++id) ASSERT_EQ(run_->Find(id)->shot.id, id);
}

}  // namespace
}  // namespace lightstage
