// kill -9 at any point of a capture: the next start lists the run as interrupted, resume completes it, and the finished set equals one
// that was never interrupted: the same files, the same pixels, every shot once.
#include <csignal>
#include <random>
#include <set>

#include "dataset/basis_exr.h"
#include "dataset/sha256.h"
#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

namespace fs = std::filesystem;

// 4 x 6 basis images, 5 dark and 3 reference frames.
const std::vector<std::string> kPlan = {"light-stage", "--azimuths",   "4", "--lamps",
                                        "10-15",       "--dark-every", "6", "--reference-every",
                                        "12"};
constexpr int kShots = 32;

// A finished set with what may differ between two captures taken out: the run's name, times, the cameras' counts, and the checksums, which
// sum over these. They are checked here instead.
struct Set {
  Json manifest;
  std::map<std::string, DecodedBasis> images;
  std::map<std::string, std::string> texts;  // all other files
};

void MaskShot(Json& shot) {
  for (const char* key : {"captured_at", "sha256", "bytes", "lit_at_ns"}) {
    EXPECT_TRUE(shot.contains(key)) << key << " in " << shot;
    shot[key] = "masked";
  }
  for (Json& exposure : shot["exposures"]) {
    for (const char* key : {"start_ns", "end_ns", "device_timestamp_ns", "frame"}) {
      EXPECT_TRUE(exposure.contains(key)) << key << " in " << exposure;
      exposure[key] = "masked";
    }
  }
}

Set ReadSet(const fs::path& run) {
  Set set;
  set.manifest = Json::parse(ReadText(run / "manifest.json"), nullptr, false);
  EXPECT_TRUE(set.manifest.is_object());
  std::set<int> ids;
  for (Json& shot : set.manifest["shots"]) {
    EXPECT_TRUE(ids.insert(shot["shot"].get<int>()).second) << "twice: " << shot;
    EXPECT_EQ(Sha256Hex(ReadText(run / shot["file"].get<std::string>())), shot["sha256"]);
    MaskShot(shot);
  }
  EXPECT_EQ(ids.size(), static_cast<size_t>(kShots));
  for (const char* key : {"run", "name", "created_at"}) {
    EXPECT_TRUE(set.manifest.contains(key)) << key;
    set.manifest[key] = "masked";
  }
  for (const auto& entry : fs::recursive_directory_iterator(run)) {
    if (!entry.is_regular_file()) continue;
    std::string name = fs::relative(entry.path(), run).string();
    if (name.ends_with(".exr")) {
      auto image = ReadBasisExr(entry.path().string());
      EXPECT_TRUE(image.ok()) << image.status();
      if (image.ok()) set.images.emplace(name, *std::move(image));
    } else {
      // The journal is in the order of storing and the header names the run.
      bool own = name == "journal" || name == "run.json" || name == "manifest.json";
      set.texts[name] = own ? "masked" : ReadText(entry.path());
    }
  }
  return set;
}

void ExpectEqual(const Set& got, const Set& whole) {
  EXPECT_EQ(got.manifest, whole.manifest) << Json::diff(whole.manifest, got.manifest).dump(1);
  EXPECT_EQ(got.texts, whole.texts);
  ASSERT_EQ(got.images.size(), whole.images.size());
  for (const auto& [name, image] : whole.images) {
    auto it = got.images.find(name);
    ASSERT_NE(it, got.images.end()) << name;
    const DecodedBasis& other = it->second;
    ASSERT_TRUE(other.image.pixels.SameShape(image.image.pixels)) << name;
    auto a = other.image.pixels.pixels(), b = image.image.pixels.pixels();
    EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin())) << name << " has other pixels";
    EXPECT_EQ(other.image.flags, image.image.flags) << name;
    EXPECT_EQ(other.attributes.shot.id, image.attributes.shot.id) << name;
    EXPECT_EQ(other.attributes.shot.condition, image.attributes.shot.condition) << name;
    EXPECT_EQ(other.attributes.exposures_s, image.attributes.exposures_s) << name;
  }
}

// Basis images below this folder by now.
int ImagesIn(const fs::path& folder) {
  int images = 0;
  std::error_code gone;  // what is renamed meanwhile
  for (fs::recursive_directory_iterator entry(folder, gone), end; entry != end;
       entry.increment(gone)) {
    images += entry->path().extension() == ".exr" ? 1 : 0;
  }
  return images;
}

class CrashTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    TestFolder folder;
    Daemon daemon(folder, SmallRig());
    std::string run = daemon.Capture(kPlan);
    whole_ = new Set(ReadSet(daemon.RunFolder(run)));
    EXPECT_EQ(whole_->images.size(), static_cast<size_t>(kShots));
  }
  static void TearDownTestSuite() {
    delete whole_;
    whole_ = nullptr;
  }

  // After a crash in `folder`: restarts, resumes if there is something to resume, and compares.
  void RecoverAndCompare(const TestFolder& folder) {
    Daemon daemon(folder, SmallRig());
    Json runs = daemon.Ctl({"runs", "list"}).json()["runs"];
    if (runs.empty()) {
      // Killed before the run was there; the next one is not disturbed by what is left of it.
      std::string run = daemon.Capture(kPlan);
      EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
      ExpectEqual(ReadSet(daemon.RunFolder(run)), *whole_);
      return;
    }
    ASSERT_EQ(runs.size(), 1u);
    std::string run = runs[0]["name"];
    if (runs[0]["state"] != "RUN_STATE_SUCCEEDED") {  // the kill may have come too late
      ASSERT_EQ(runs[0]["state"], "RUN_STATE_INTERRUPTED") << runs[0];
      ++interrupted_;
      Answer resume = daemon.Ctl({"runs", "resume", run});
      ASSERT_EQ(resume.code, 0) << resume.err;
      Json finished = daemon.WaitForRun(run, "SUCCEEDED");
      EXPECT_EQ(finished["doneShots"], kShots);
    }
    Answer verify = daemon.Ctl({"runs", "verify", run});
    EXPECT_EQ(verify.code, 0) << verify.out;
    ExpectEqual(ReadSet(daemon.RunFolder(run)), *whole_);
  }

  int interrupted_ = 0;  // crashes that came amid a run
  static Set* whole_;
};

Set* CrashTest::whole_ = nullptr;

// Every named point, early, amid and late. A capture renames 3 files to begin, one per shot, then lights_000.lp and the manifest;
// journal appends are fewer than shots, because one append may hold several.
TEST_F(CrashTest, Failpoints) {
  for (const char* point :
       {"env.before_rename=kill:1", "env.before_rename=kill:3", "env.before_rename=kill:4",
        "env.before_rename=kill:19", "env.before_rename=kill:36", "env.before_rename=kill:37",
        "store.after_rename=kill:1", "store.after_rename=kill:14", "store.after_rename=kill:32",
        "store.before_journal_append=kill:1", "store.before_journal_append=kill:2",
        "store.before_journal_append=kill:5", "store.after_journal_append=kill:1",
        "store.after_journal_append=kill:2", "store.after_journal_append=kill:5",
        "store.after_journal_sync=kill:1", "store.after_journal_sync=kill:3"}) {
    SCOPED_TRACE(point);
    TestFolder folder;
    {
      Daemon daemon(folder, SmallRig(), {.failpoints = point});
      std::vector<std::string> capture = {"capture", "--detach"};
      capture.insert(capture.end(), kPlan.begin(), kPlan.end());
      daemon.Ctl(capture);  // fails if the daemon dies before it answers
      ASSERT_EQ(daemon.process().Wait(Milliseconds(20000)), 128 + SIGKILL)
          << "the point was not reached";
    }
    RecoverAndCompare(folder);
  }
}

TEST_F(CrashTest, TwentyMoments) {
  std::mt19937 random(20040501);
  // At any moment after so many images: how fast they come is the machine's.
  std::uniform_int_distribution<int> images(0, kShots - 1), moment_us(0, 30000);
  for (int i = 0; i < 20; ++i) {
    const int least = images(random);
    const auto delay = std::chrono::microseconds(moment_us(random));
    SCOPED_TRACE("killed " + std::to_string(delay.count()) + " us after image " +
                 std::to_string(least) + ", number " + std::to_string(i));
    TestFolder folder;
    {
      Daemon daemon(folder, SmallRig());
      std::vector<std::string> capture = {"capture", "--detach"};
      capture.insert(capture.end(), kPlan.begin(), kPlan.end());
      auto client = daemon.Start(capture);
      EXPECT_TRUE(WaitUntil(Milliseconds(30000), [&] { return ImagesIn(folder.path()) >= least; }));
      std::this_thread::sleep_for(delay);
      daemon.Kill();
    }
    RecoverAndCompare(folder);
    if (HasFailure()) break;
  }
  EXPECT_GT(interrupted_, 3) << "the moments were not amid the runs";
}

// Again and again, until one run is done at last.
TEST_F(CrashTest, ManyMomentsOfOneRun) {
  std::mt19937 random(20040502);
  std::uniform_int_distribution<int> shots(1, 6);
  TestFolder folder;
  std::string run;
  int crashes = 0;
  for (bool done = false; !done && !HasFailure(); ++crashes) {
    Daemon daemon(folder, RealTime(SmallRig()));
    int before = 0;
    if (run.empty()) {
      run = daemon.StartRun(kPlan);
    } else {
      Json then = daemon.Run(run);
      if (then["state"] == "RUN_STATE_SUCCEEDED") break;  // it ended before it could be killed
      before = then["doneShots"];
      ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
    }
    int until = before + shots(random);
    Json now;
    EXPECT_TRUE(WaitUntil(Milliseconds(30000), [&] {
      now = daemon.Run(run);
      return now["doneShots"] >= until || now["state"] == "RUN_STATE_SUCCEEDED";
    })) << now;
    EXPECT_GE(now["doneShots"].get<int>(), before) << "a stored shot was lost";
    done = now["state"] == "RUN_STATE_SUCCEEDED";
    daemon.Kill();
  }
  EXPECT_GT(crashes, 2);
  Daemon daemon(folder, RealTime(SmallRig()));
  EXPECT_EQ(daemon.Run(run)["state"], "RUN_STATE_SUCCEEDED");
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  Set set = ReadSet(daemon.RunFolder(run));
  set.texts["rig.toml"] = whole_->texts["rig.toml"];  // real time here
  ExpectEqual(set, *whole_);
}

}  // namespace
}  // namespace lightstage
