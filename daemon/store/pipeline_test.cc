#include "daemon/store/pipeline.h"

#include <atomic>
#include <set>

#include "base/failpoint.h"
#include "base/fault_env.h"
#include "base/status.h"
#include "daemon/store/test_run.h"
#include "dataset/basis_exr.h"
#include "dataset/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const WallTime kNow = ParseUtc("2004-05-06T07:08:09Z").value();

class PipelineTest : public ::testing::Test {
 protected:
  PipelineTest() {
    auto data = DataDirectory::Open(env_, temp_.path()).value();
    run_ = data->CreateRun(TestHeader(100), "rig", kNow).value();
  }
  ~PipelineTest() override { EXPECT_TRUE(SetFailpoints("").ok()); }

  std::string Path(const std::string& name) const { return run_->path() + "/" + name; }
  // Every record's file is there, with the recorded sum; no other image is.
  void ExpectConsistent() {
    std::set<std::string> recorded;
    for (const ShotRecord& record : run_->Records(0, 1000)) {
      recorded.insert(record.file);
      EXPECT_EQ(Sha256Hex(env_.ReadFile(Path(record.file)).value()), record.sha256);
    }
    std::vector<FolderFile> files = run_->ListFiles().value();
    for (const FolderFile& file : files) {
      bool image = file.path.find('/') != std::string::npos;
      EXPECT_TRUE(!image || recorded.count(file.path) > 0) << file.path;
    }
  }

  TemporaryDirectory temp_;
  FaultEnv env_{PosixEnv()};
  std::unique_ptr<RunFolder> run_;
};

TEST_F(PipelineTest, StoresShotsWithEverythingTheyCameWith) {
  EXPECT_THAT(Capture(*run_, 0, 25, 3), IsEmpty());
  EXPECT_EQ(run_->count(), 25u);
  ExpectConsistent();
  ShotRecord record = run_->Find(13).value();
  EXPECT_EQ(record.file, "basis/000013.exr");
  EXPECT_EQ(record.shot.pose, TestShot(13).shot.pose);
  EXPECT_EQ(record.captured_at, "1970-01-12T13:46:53.000000Z");
  EXPECT_EQ(record.exposures.at(0).frame_sequence, 13u);
  DecodedBasis basis = ReadBasisExr(Path(record.file)).value();
  EXPECT_EQ(basis.image.pixels.at(3, 2, 1), 3.5f);
  EXPECT_EQ(basis.attributes.run_id, run_->header().id);
  EXPECT_EQ(basis.attributes.shot.id, 13u);
  EXPECT_EQ(basis.attributes.shot.condition, TestShot(13).shot.condition);
  EXPECT_EQ(basis.attributes.direction, Vec3(0, 0.6, 0.8));
  EXPECT_FALSE(run_->Find(8)->direction.has_value());
  EXPECT_EQ(run_->Find(8)->file, "dark/000008.exr");
}

TEST_F(PipelineTest, AnOutcomeComesOnlyAfterItsRecordIsDurable) {
  std::atomic<int> checked = 0;
  {
    Pipeline pipeline(*run_, TestDevelop, {.workers = 2, .queue_shots = 4},
                      [&](ShotOutcome outcome) {
                        // What a reader of the disk sees at this moment.
                        auto on_disk = RunFolder::Open(PosixEnv(), run_->path()).value();
                        EXPECT_TRUE(on_disk->HasRecord(outcome.shot_id));
                        ++checked;
                      });
    for (uint64_t id = 0; id < 12; ++id) PutPatiently(pipeline, TestShot(id));
  }
  EXPECT_EQ(checked, 12);
}

TEST_F(PipelineTest, WhatHadAnOutcomeSurvivesAPowerCut) {
  EXPECT_THAT(Capture(*run_, 0, 20), IsEmpty());
  std::string path = run_->path();
  run_.reset();
  ASSERT_TRUE(env_.LosePower().ok());
  run_ = RunFolder::Open(env_, path).value();
  EXPECT_EQ(run_->count(), 20u);
  ExpectConsistent();
}

TEST_F(PipelineTest, AFullDiskFailsShotsCleanlyAndThenGoesOn) {
  EXPECT_THAT(Capture(*run_, 0, 4), IsEmpty());
  env_.FillDiskAfter(5000);
  std::vector<ShotOutcome> failed = Capture(*run_, 4, 16);
  ASSERT_FALSE(failed.empty());
  for (const ShotOutcome& outcome : failed) {
    EXPECT_EQ(ErrorReason(outcome.record.status()), "DISK_FULL");
    EXPECT_FALSE(run_->HasRecord(outcome.shot_id));
  }
  EXPECT_EQ(run_->count(), 16 - failed.size());
  ExpectConsistent();
  env_.FreeDisk();
  Outcomes outcomes;
  Pipeline pipeline(*run_, TestDevelop, {.workers = 2, .queue_shots = 4}, outcomes.fn());
  for (const ShotOutcome& outcome : failed)
    PutPatiently(pipeline, TestShot(outcome.shot_id, /*attempt=*/2));
  pipeline.Drain();
  EXPECT_EQ(run_->count(), 16u);
  EXPECT_EQ(run_->totals().retakes, failed.size());
  ExpectConsistent();
}

TEST_F(PipelineTest, EveryKindOfFailureIsTheShotsOutcomeAndLeavesNoFile) {
  struct Case {
    const char* name;
    std::function<void()> inject;
  };
  absl::Status io = Error(absl::StatusCode::kInternal, "FILE_IO", "io");
  const Case cases[] = {
      {"write", [&] { env_.Fail(EnvOp::kWriteFile, "basis/", io); }},
      {"directory sync", [&] { env_.Fail(EnvOp::kSyncDirectory, "basis", io); }},
      {"journal append", [&] { env_.Fail(EnvOp::kAppend, "journal", io); }},
      {"journal sync", [&] { env_.Fail(EnvOp::kSync, "journal", io); }},
      {"env.before_rename", [] { ASSERT_TRUE(SetFailpoints("env.before_rename=error:1").ok()); }},
      {"store.after_rename", [] { ASSERT_TRUE(SetFailpoints("store.after_rename=error:1").ok()); }},
      {"store.before_journal_append",
       [] { ASSERT_TRUE(SetFailpoints("store.before_journal_append=error:1").ok()); }},
      {"store.after_journal_append",
       [] { ASSERT_TRUE(SetFailpoints("store.after_journal_append=error:1").ok()); }},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    c.inject();
    EXPECT_THAT(Capture(*run_, 1, 2, 1), SizeIs(1));
    EXPECT_EQ(run_->count(), 0u);
    ExpectConsistent();
  }
  EXPECT_THAT(Capture(*run_, 1, 2, 1), IsEmpty());
  ExpectConsistent();
}

TEST_F(PipelineTest, AnErrorAfterTheJournalIsDurableDoesNotUndoIt) {
  ASSERT_TRUE(SetFailpoints("store.after_journal_sync=error:1").ok());
  EXPECT_THAT(Capture(*run_, 1, 2, 1), IsEmpty());
  EXPECT_TRUE(run_->HasRecord(1));
  ExpectConsistent();
}

TEST_F(PipelineTest, AShotWithARecordIsRefusedAndItsFileStays) {
  EXPECT_THAT(Capture(*run_, 1, 2), IsEmpty());
  std::vector<ShotOutcome> failed = Capture(*run_, 1, 2);
  ASSERT_THAT(failed, SizeIs(1));
  EXPECT_EQ(ErrorReason(failed[0].record.status()), "SHOT_DUPLICATE");
  ExpectConsistent();
}

TEST_F(PipelineTest, DevelopErrorsAndWrongShapesAreOutcomes) {
  Outcomes outcomes;
  Pipeline pipeline(
      *run_,
      [](const RawShot& raw) -> absl::StatusOr<Developed> {
        if (raw.shot.id == 1) return absl::DataLossError("frame");
        Developed developed = TestDevelop(raw).value();
        if (raw.shot.id == 2) developed.image.pixels = Image(4, 4, 3);
        if (raw.shot.id == 3) developed.image.pixels.at(0, 0, 0) = NAN;
        return developed;
      },
      {.workers = 1, .queue_shots = 1}, outcomes.fn());
  for (uint64_t id = 1; id < 5; ++id) PutPatiently(pipeline, TestShot(id));
  pipeline.Drain();
  for (const ShotOutcome& outcome : outcomes.Take()) {
    std::string message(outcome.record.status().message());
    switch (outcome.shot_id) {
      case 1:
        EXPECT_EQ(message, "frame");
        break;
      case 2:
        EXPECT_THAT(message, HasSubstr("shot 2 is 4x4x3, the run's images are 16x8x3"));
        break;
      case 3:
        EXPECT_THAT(message, HasSubstr("not finite"));
        break;
      default:
        EXPECT_TRUE(outcome.record.ok()) << outcome.record.status();
    }
  }
}

TEST_F(PipelineTest, PutWaitsWhileTheQueueIsFull) {
  Mutex mutex;
  CondVar went;
  bool go = false;
  std::atomic<int> put = 0;
  Outcomes outcomes;
  Pipeline pipeline(
      *run_,
      [&](const RawShot& raw) {
        MutexLock lock(&mutex);
        while (!go) went.Wait(&mutex);
        return TestDevelop(raw);
      },
      {.workers = 1, .queue_shots = 2}, outcomes.fn());
  std::thread producer([&] {
    for (uint64_t id = 0; id < 8; ++id) {
      PutPatiently(pipeline, TestShot(id));
      ++put;
    }
  });
  for (int i = 0; i < 2000 && put < 3; ++i) absl::SleepFor(absl::Milliseconds(1));
  absl::SleepFor(absl::Milliseconds(20));
  EXPECT_EQ(put, 3);  // one with the worker, two waiting
  {
    MutexLock lock(&mutex);
    go = true;
    went.SignalAll();
  }
  producer.join();
  pipeline.Drain();
  EXPECT_EQ(run_->count(), 8u);
}

}  // namespace
}  // namespace lightstage
