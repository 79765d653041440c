// Files that were damaged behind the daemon's back: found, named, and no reason not to show the other runs.
#include <sys/stat.h>

#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

namespace fs = std::filesystem;

bool Says(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

class Damage : public ::testing::Test {
 protected:
  // Two runs: `good` stays as it is, `bad` ends as told.
  void Capture(bool finished, const std::vector<std::string>& flags = {}) {
    Daemon daemon(folder_, RealTime(SmallRig()));
    good_ = daemon.Capture({"light-stage", "--azimuths", "2", "--lamps", "0-3"});
    std::vector<std::string> plan = {"light-stage", "--azimuths", "4", "--lamps", "0-9"};
    plan.insert(plan.end(), flags.begin(), flags.end());
    bad_ = daemon.StartRun(plan);
    if (finished)
      daemon.WaitForRun(bad_, "SUCCEEDED");
    else
      daemon.WaitForShots(bad_, 8);
    daemon.Kill();
    path_ = daemon.RunFolder(bad_);
  }
  // Restarts the daemon, which must still know both runs.
  std::unique_ptr<Daemon> Restart() {
    auto daemon = std::make_unique<Daemon>(folder_, RealTime(SmallRig()));
    Answer list = daemon->Ctl({"runs", "list"});
    EXPECT_EQ(list.code, 0) << list.err;
    std::map<std::string, std::string> states;
    for (const Json& run : list.json()["runs"]) states[run["name"]] = run["state"];
    EXPECT_EQ(states.size(), 2u) << list.out;
    EXPECT_EQ(states[good_], "RUN_STATE_SUCCEEDED");
    EXPECT_EQ(daemon->Ctl({"runs", "verify", good_}).code, 0);
    // And it goes on working.
    EXPECT_EQ(daemon->Ctl({"capture", "light-stage", "--azimuths", "1", "--lamps", "0"}).code, 0);
    return daemon;
  }

  TestFolder folder_;
  std::string good_, bad_;
  fs::path path_;
};

TEST_F(Damage, TruncatedMissingAndStrangeImagesAreNamed) {
  Capture(true);
  fs::resize_file(path_ / "basis/000003.exr", 500);
  fs::resize_file(path_ / "basis/000004.exr", 0);
  fs::remove(path_ / "basis/000005.exr");
  WriteText(path_ / "basis/999999.exr", "nobody took me");
  auto daemon = Restart();
  Answer verify = daemon->Ctl({"runs", "verify", bad_});
  EXPECT_EQ(verify.code, 5);
  std::map<std::string, std::string> problems = Problems(verify);
  EXPECT_EQ(problems.size(), 4u) << verify.out;
  EXPECT_EQ(problems["basis/000003.exr"], "FILE_SIZE");
  EXPECT_EQ(problems["basis/000004.exr"], "FILE_SIZE");
  EXPECT_TRUE(problems.count("basis/000005.exr"));
  EXPECT_EQ(problems["basis/999999.exr"], "FILE_UNRECORDED");
  Answer fetch = daemon->Ctl({"runs", "fetch", bad_, folder_ / "copy"});
  EXPECT_EQ(fetch.code, 5) << fetch.err;
  EXPECT_TRUE(Says(fetch.err, "basis/000003.exr")) << fetch.err;
}

TEST_F(Damage, TheDaemonThatCapturedARunFindsWhatHappenedToItSince) {
  Daemon daemon(folder_, SmallRig());
  std::string run = daemon.Capture({"light-stage", "--azimuths", "2", "--lamps", "0-3"});
  fs::path path = daemon.RunFolder(run);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  WriteText(path / "lights_000.lp", "1\nbasis/000000.exr 0 0 1\n");
  std::string manifest = ReadText(path / "manifest.json");
  manifest[manifest.size() / 2] ^= 1;
  WriteText(path / "manifest.json", manifest);
  std::string journal = ReadText(path / "journal");
  journal[journal.size() / 2] ^= 1;
  WriteText(path / "journal", journal);
  WriteText(path / "basis/999999.exr", "nobody took me");
  Answer verify = daemon.Ctl({"runs", "verify", run});
  EXPECT_EQ(verify.code, 5);
  std::map<std::string, std::string> problems = Problems(verify);
  EXPECT_EQ(problems["journal"], "JOURNAL_CORRUPT") << verify.out;
  EXPECT_EQ(problems["basis/999999.exr"], "FILE_UNRECORDED") << verify.out;
  journal[journal.size() / 2] ^= 1;
  WriteText(path / "journal", journal);
  problems = Problems(daemon.Ctl({"runs", "verify", run}));
  EXPECT_EQ(problems.count("journal"), 0u);
  EXPECT_EQ(problems["lights_000.lp"], "LIGHTS_MISMATCH");
  EXPECT_EQ(problems.count("manifest.json"), 1u);
}

TEST_F(Damage, ACorruptManifestAndLightPositionsAreFound) {
  Capture(true);
  std::string manifest = ReadText(path_ / "manifest.json");
  WriteText(path_ / "manifest.json", manifest.substr(0, manifest.size() / 2));
  WriteText(path_ / "lights_000.lp", "1\nbasis/000000.exr 0 0 1\n");
  auto daemon = Restart();
  std::map<std::string, std::string> problems = Problems(daemon->Ctl({"runs", "verify", bad_}));
  EXPECT_EQ(problems["manifest.json"], "MANIFEST_CORRUPT");
  EXPECT_EQ(problems["lights_000.lp"], "LIGHTS_MISMATCH");
}

TEST_F(Damage, ACorruptJournalIsSaidAndNotContinued) {
  Capture(false);
  std::string journal = ReadText(path_ / "journal");
  journal[journal.size() / 2] ^= 0x04;
  WriteText(path_ / "journal", journal);
  auto daemon = Restart();
  Json run = daemon->Run(bad_);
  EXPECT_EQ(run["state"], "RUN_STATE_FAILED");
  EXPECT_EQ(run["reason"]["reason"], "JOURNAL_CORRUPT") << run;
  EXPECT_TRUE(Says(run["reason"]["message"], "line")) << run["reason"];
  EXPECT_GT(run["doneShots"].get<int>(), 0) << "the good lines count";
  Answer resume = daemon->Ctl({"runs", "resume", bad_});
  EXPECT_EQ(resume.code, 1);
  EXPECT_TRUE(Says(resume.err, "JOURNAL_CORRUPT")) << resume.err;
  EXPECT_TRUE(Says(resume.err, "runs verify")) << resume.err;
  Answer verify = daemon->Ctl({"runs", "verify", bad_});
  EXPECT_EQ(verify.code, 5);
  EXPECT_TRUE(Problems(verify).count("journal")) << verify.out;
}

TEST_F(Damage, ATornJournalIsACrashAndIsResumed) {
  Capture(false);
  auto size = fs::file_size(path_ / "journal");
  fs::resize_file(path_ / "journal", size - 7);
  auto daemon = Restart();
  EXPECT_EQ(daemon->Run(bad_)["state"], "RUN_STATE_INTERRUPTED");
  Answer resume = daemon->Ctl({"runs", "resume", bad_});
  ASSERT_EQ(resume.code, 0) << resume.err;
  EXPECT_EQ(daemon->WaitForRun(bad_, "SUCCEEDED")["doneShots"], 40);
  Answer verify = daemon->Ctl({"runs", "verify", bad_});
  EXPECT_EQ(verify.code, 0) << verify.out;
}

TEST_F(Damage, ImagesThatAreGoneAreTakenAgainWhenTheRunGoesOn) {
  Capture(false);
  fs::remove(path_ / "basis/000003.exr");
  fs::resize_file(path_ / "basis/000005.exr", 100);
  WriteText(path_ / "basis/notes.txt", "mine");
  auto daemon = Restart();
  Answer resume = daemon->Ctl({"runs", "resume", bad_});
  ASSERT_EQ(resume.code, 0) << resume.err;
  EXPECT_EQ(daemon->WaitForRun(bad_, "SUCCEEDED")["doneShots"], 40);
  EXPECT_TRUE(Says(daemon->log(), "basis/000003.exr is gone")) << daemon->log();
  EXPECT_EQ(ReadText(path_ / "basis/notes.txt"), "mine");
  fs::remove(path_ / "basis/notes.txt");
  Answer verify = daemon->Ctl({"runs", "verify", bad_});
  EXPECT_EQ(verify.code, 0) << verify.out;
}

TEST_F(Damage, ARunsOwnFolderIsNoPlaceToFetchItTo) {
  Daemon daemon(folder_, SmallRig());
  std::string run = daemon.Capture({"light-stage", "--azimuths", "2", "--lamps", "0-3"});
  Answer fetch = daemon.Ctl({"runs", "fetch", run, daemon.RunFolder(run)});
  EXPECT_EQ(fetch.code, 1);
  EXPECT_TRUE(Says(fetch.err, "FOLDER_IS_THE_RUNS")) << fetch.err;
}

TEST_F(Damage, AJournalThatIsTakenAwayPausesTheRun) {
  Daemon daemon(folder_, RealTime(SmallRig()));
  std::string run = daemon.StartRun({"light-stage", "--azimuths", "4", "--lamps", "0-9"});
  daemon.WaitForShots(run, 4);
  fs::rename(daemon.RunFolder(run) / "journal", daemon.RunFolder(run) / "elsewhere");
  EXPECT_EQ(daemon.WaitForRun(run, "PAUSED")["reason"]["reason"], "FILE_NOT_FOUND");
  fs::rename(daemon.RunFolder(run) / "elsewhere", daemon.RunFolder(run) / "journal");
  ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
  EXPECT_EQ(daemon.WaitForRun(run, "SUCCEEDED")["doneShots"], 40);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
}

TEST_F(Damage, ImagesThatAreTakenAwayDoNotEndInSuccess) {
  auto daemon = std::make_unique<Daemon>(folder_, RealTime(SmallRig()));
  bad_ = daemon->StartRun({"light-stage", "--azimuths", "4", "--lamps", "0-9"});
  daemon->WaitForShots(bad_, 8);
  path_ = daemon->RunFolder(bad_);
  fs::remove(path_ / "basis/000001.exr");
  EXPECT_EQ(daemon->WaitForRun(bad_, "PAUSED")["reason"]["reason"], "IMAGES_LOST");
  EXPECT_EQ(daemon->Terminate(), 0);
  daemon = std::make_unique<Daemon>(folder_, RealTime(SmallRig()));
  ASSERT_EQ(daemon->Ctl({"runs", "resume", bad_}).code, 0);
  EXPECT_EQ(daemon->WaitForRun(bad_, "SUCCEEDED")["doneShots"], 40);
  EXPECT_EQ(daemon->Ctl({"runs", "verify", bad_}).code, 0);
}

TEST_F(Damage, StrangeThingsAmongTheImagesAreNamedAndHangNobody) {
  Daemon daemon(folder_, SmallRig());
  std::string run = daemon.Capture({"light-stage", "--azimuths", "2", "--lamps", "0-3"});
  fs::path path = daemon.RunFolder(run);
  WriteText(path / "basis/caf\xe9.txt", "not UTF-8");
  fs::remove(path / "basis/000002.exr");
  ASSERT_EQ(mkfifo((path / "basis/000002.exr").c_str(), 0600), 0);
  fs::create_directory(path / "basis/folder.exr");
  Answer verify = daemon.Ctl({"runs", "verify", run});
  EXPECT_EQ(verify.code, 5) << verify.err;
  EXPECT_EQ(Problems(verify)["basis/000002.exr"], "FILE_NOT_REGULAR") << verify.out;
  EXPECT_EQ(daemon.Terminate(), 0);
}

TEST_F(Damage, AReferenceThatIsDamagedTellsNothingAndThatIsSaid) {
  Capture(false, {"--reference-every", "4"});
  std::string last;
  for (const auto& entry : fs::directory_iterator(path_ / "reference"))
    last = std::max(last, entry.path().string());
  std::string picture = ReadText(last);
  picture[picture.size() / 2] ^= 1;
  WriteText(last, picture);
  auto daemon = Restart();
  ASSERT_EQ(daemon->Ctl({"runs", "resume", bad_}).code, 0);
  Json run = daemon->WaitForRun(bad_, "PAUSED");
  EXPECT_EQ(run["reason"]["reason"], "REFERENCE_DAMAGED") << run;
  ASSERT_EQ(daemon->Ctl({"runs", "resume", bad_}).code, 0);
  daemon->WaitForRun(bad_, "SUCCEEDED");
  EXPECT_EQ(Problems(daemon->Ctl({"runs", "verify", bad_})).size(), 1u);
}

TEST_F(Damage, AnEmptyJournalIsSaid) {
  Capture(false);
  WriteText(path_ / "journal", "");
  auto daemon = Restart();
  Json run = daemon->Run(bad_);
  EXPECT_EQ(run["state"], "RUN_STATE_FAILED");
  EXPECT_EQ(run["reason"]["reason"], "JOURNAL_CORRUPT") << run;
}

TEST_F(Damage, ARunThatCannotBeReadAtAllIsStillListed) {
  Capture(false);
  WriteText(path_ / "run.json", "{\"id\": ");
  auto daemon = Restart();
  for (const Json& run : daemon->Ctl({"runs", "list"}).json()["runs"]) {
    if (run["name"] != bad_) continue;
    EXPECT_EQ(run["state"], "RUN_STATE_FAILED");
    EXPECT_TRUE(Says(run["reason"]["message"], "run.json")) << run;
  }
  EXPECT_EQ(daemon->Ctl({"runs", "show", bad_}).code, 1);
}

}  // namespace
}  // namespace lightstage
