#include "daemon/store/verify.h"

#include "base/status.h"
#include "daemon/store/finish.h"
#include "daemon/store/test_run.h"
#include "dataset/light_positions.h"
#include "dataset/manifest.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

const WallTime kNow = ParseUtc("2004-05-06T07:08:09Z").value();
constexpr uint64_t kShots = 20;

class VerifyTest : public ::testing::Test {
 protected:
  VerifyTest() {
    auto data = DataDirectory::Open(PosixEnv(), temp_.path()).value();
    run_ = data->CreateRun(TestHeader(kShots), "rig", kNow).value();
    EXPECT_THAT(Capture(*run_, 0, kShots), IsEmpty());
    EXPECT_TRUE(Finish(*run_).ok());
    EXPECT_TRUE(run_->AppendState(RunState::kSucceeded, absl::OkStatus(), kNow).ok());
    Reopen();
  }
  void Reopen() {
    std::string path = run_->path();
    run_ = RunFolder::Open(PosixEnv(), path).value();
  }
  std::string Path(const std::string& name) const { return run_->path() + "/" + name; }

  // The one problem there is, as "file: REASON: message".
  std::string OnlyProblem() {
    std::vector<VerifyProblem> problems = Verify(*run_, {}).value();
    EXPECT_THAT(problems, SizeIs(1));
    if (problems.empty()) return "";
    return problems[0].file + ": " + ErrorReason(problems[0].reason) + ": " +
           std::string(problems[0].reason.message());
  }

  TemporaryDirectory temp_;
  std::unique_ptr<RunFolder> run_;
};

TEST_F(VerifyTest, AGoodRunHasNoProblemsAndProgressCounts) {
  uint64_t last = 0, total = 0;
  VerifyHooks hooks;
  hooks.progress = [&](uint64_t checked, uint64_t of) {
    EXPECT_GE(checked, last);
    last = checked, total = of;
  };
  EXPECT_THAT(Verify(*run_, hooks).value(), IsEmpty());
  EXPECT_EQ(total, kShots + 3);  // journal, manifest, one file of lights
  EXPECT_EQ(last, total);
}

TEST_F(VerifyTest, EveryFlippedBitInAnImageIsFound) {
  size_t size = PosixEnv().FileSize(Path("basis/000003.exr")).value();
  for (size_t byte : {size_t{0}, size / 2, size - 1}) {
    FlipBit(Path("basis/000003.exr"), byte);
    EXPECT_THAT(OnlyProblem(), HasSubstr("basis/000003.exr: FILE_CHECKSUM"));
    FlipBit(Path("basis/000003.exr"), byte);
  }
  EXPECT_THAT(Verify(*run_, {}).value(), IsEmpty());
}

TEST_F(VerifyTest, MissingTruncatedAndForeignFiles) {
  std::string bytes = PosixEnv().ReadFile(Path("dark/000008.exr")).value();
  ASSERT_TRUE(PosixEnv().Truncate(Path("dark/000008.exr"), bytes.size() - 1).ok());
  EXPECT_THAT(OnlyProblem(), HasSubstr("dark/000008.exr: FILE_SIZE"));
  ASSERT_TRUE(PosixEnv().Remove(Path("dark/000008.exr")).ok());
  EXPECT_THAT(OnlyProblem(), HasSubstr("dark/000008.exr: FILE_NOT_FOUND"));
  ASSERT_TRUE(PosixEnv().WriteFile(Path("dark/000008.exr"), bytes).ok());
  ASSERT_TRUE(PosixEnv().WriteFile(Path("basis/000100.exr"), bytes).ok());
  EXPECT_THAT(OnlyProblem(), HasSubstr("basis/000100.exr: FILE_UNRECORDED"));
}

TEST_F(VerifyTest, AFlippedBitInTheJournal) {
  FlipBit(Path("journal"), 700);
  Reopen();
  std::vector<VerifyProblem> problems = Verify(*run_, {}).value();
  std::string all;
  for (const VerifyProblem& problem : problems) {
    all += problem.file + ": " + std::string(problem.reason.message()) + "\n";
  }
  EXPECT_THAT(all, HasSubstr("journal: " + Path("journal") + ": line 2 at byte"));
  EXPECT_THAT(all, HasSubstr("manifest.json: holds 20 shots, the journal 19"));
  // That a record is missing follows from it and is not told twice.
  EXPECT_THAT(all, Not(HasSubstr("19 of 20")));
}

TEST_F(VerifyTest, ATornJournalIsSeenWithoutBeingTouched) {
  uint64_t size = PosixEnv().FileSize(Path("journal")).value();
  ASSERT_TRUE(PosixEnv().Truncate(Path("journal"), size - 3).ok());
  Reopen();
  EXPECT_THAT(OnlyProblem(), HasSubstr("journal: JOURNAL_TORN"));
  EXPECT_EQ(PosixEnv().FileSize(Path("journal")).value(), size - 3);
}

TEST_F(VerifyTest, AManifestThatDiffersFromTheJournal) {
  std::string text = PosixEnv().ReadFile(Path("manifest.json")).value();
  size_t at = text.find("\"attempts\":1");
  ASSERT_NE(at, std::string::npos);
  std::string changed = text;
  changed[at + 11] = '2';
  ASSERT_TRUE(PosixEnv().WriteFile(Path("manifest.json"), changed).ok());
  EXPECT_THAT(OnlyProblem(), HasSubstr("manifest.json: MANIFEST_MISMATCH: shot 0 differs"));
  ASSERT_TRUE(PosixEnv().WriteFile(Path("manifest.json"), text.substr(0, text.size() / 2)).ok());
  EXPECT_THAT(OnlyProblem(), HasSubstr("manifest.json: MANIFEST_CORRUPT"));
  ASSERT_TRUE(PosixEnv().Remove(Path("manifest.json")).ok());
  EXPECT_THAT(OnlyProblem(), HasSubstr("manifest.json: FILE_NOT_FOUND"));
}

TEST_F(VerifyTest, LightPositionsThatDiffer) {
  ASSERT_TRUE(PosixEnv().WriteFile(Path("lights_000.lp"), "0\n").ok());
  EXPECT_THAT(OnlyProblem(), HasSubstr("lights_000.lp: LIGHTS_MISMATCH"));
}

TEST_F(VerifyTest, CanBeCancelled) {
  int asked = 0;
  VerifyHooks hooks;
  hooks.cancelled = [&] { return ++asked > 3; };
  EXPECT_EQ(Verify(*run_, hooks).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(asked, 4);
}

TEST_F(VerifyTest, ARunBeingCapturedIsCheckedAsFarAsItIs) {
  auto data = DataDirectory::Open(PosixEnv(), temp_.path() + "/2").value();
  auto run = data->CreateRun(TestHeader(kShots), "rig", kNow).value();
  EXPECT_THAT(Capture(*run, 0, 5), IsEmpty());
  ASSERT_TRUE(PosixEnv().WriteFile(run->path() + "/basis/000006.exr", "just renamed").ok());
  EXPECT_THAT(Verify(*run, {}).value(), IsEmpty());
}

TEST_F(VerifyTest, FinishWritesManifestAndLightsInOrderOfIds) {
  auto data = DataDirectory::Open(PosixEnv(), temp_.path() + "/2").value();
  auto run = data->CreateRun(TestHeader(kShots), "rig", kNow).value();
  for (uint64_t id : {3, 0, 2, 1}) EXPECT_THAT(Capture(*run, id, id + 1), IsEmpty());
  ASSERT_TRUE(Finish(*run).ok());
  Manifest manifest = ReadManifest(run->path()).value();
  ASSERT_THAT(manifest.shots, SizeIs(4));
  for (uint64_t id = 0; id < 4; ++id) EXPECT_EQ(manifest.shots[id].shot.id, id);
  EXPECT_EQ(manifest.run_id, run->header().id);
  EXPECT_EQ(manifest.plan_json, run->header().plan_json);
  auto lights =
      ParseLightPositions(PosixEnv().ReadFile(run->path() + "/lights_000.lp").value(), "lp")
          .value();
  ASSERT_THAT(lights, SizeIs(4));
  EXPECT_EQ(lights[1].file, "basis/000001.exr");
}

}  // namespace
}  // namespace lightstage
