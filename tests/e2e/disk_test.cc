// Disks that are too small or fill up. Needs a small filesystem of its own: a tmpfs, which only root may mount.
#include <fcntl.h>
#include <sys/mount.h>
#include <unistd.h>

#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

bool Says(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

class SmallDisk {
 public:
  SmallDisk(const TestFolder& folder, const std::string& size) : path_(folder / "disk") {
    std::filesystem::create_directory(path_);
    mounted_ = mount("tmpfs", path_.c_str(), "tmpfs", 0, ("size=" + size).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) umount2(path_.c_str(), MNT_DETACH);
  }
  bool mounted() const { return mounted_; }
  std::string data() const { return path_ + "/data"; }

  // Leaves nothing free.
  void Fill() const {
    int fd = open((path_ + "/ballast").c_str(), O_WRONLY | O_CREAT, 0600);
    std::string block(1 << 20, 'x');
    for (size_t size = block.size(); size > 0;) {
      if (write(fd, block.data(), size) <= 0) size /= 2;
    }
    close(fd);
  }
  void MakeRoom() const { std::filesystem::remove(path_ + "/ballast"); }

 private:
  std::string path_;
  bool mounted_ = false;
};

TEST(Disk, APlanThatDoesNotFitIsRefusedWithBothFigures) {
  TestFolder folder;
  SmallDisk disk(folder, "80m");
  if (!disk.mounted()) GTEST_SKIP() << "only root may mount a tmpfs";
  Daemon daemon(folder, SmallRig(), {.data = disk.data()});
  Answer answer = daemon.Ctl({"capture", "light-stage", "--azimuths", "128"});
  EXPECT_EQ(answer.code, 1);
  EXPECT_TRUE(Says(answer.err, "DISK_TOO_SMALL")) << answer.err;
  // What it needs, and what is there.
  Json estimate = daemon.Ctl({"plan", "light-stage", "--azimuths", "128"}).json();
  long long free = std::stoll(estimate["freeBytes"].get<std::string>());
  EXPECT_LT(free, 80 << 20);
  char figure[32];
  std::snprintf(figure, sizeof(figure), "%.1f MB", static_cast<double>(free) / 1e6);
  EXPECT_TRUE(Says(answer.err, figure)) << answer.err << " free: " << figure;
  long long needed = std::stoll(estimate["bytes"].get<std::string>()) + (64 << 20);
  std::snprintf(figure, sizeof(figure), "%.1f MB", static_cast<double>(needed) / 1e6);
  EXPECT_TRUE(Says(answer.err, figure)) << answer.err << " needed: " << figure;
  // The dry run says it too.
  EXPECT_TRUE(Says(estimate["notes"].dump(), figure)) << estimate;
  EXPECT_TRUE(daemon.Ctl({"runs", "list"}).json()["runs"].empty());
  // A small one fits.
  daemon.Capture({"light-stage", "--azimuths", "2", "--lamps", "0-3"});
}

TEST(Disk, FullInMidRunPausesDarkAndGoesOnWhenThereIsRoom) {
  TestFolder folder;
  SmallDisk disk(folder, "80m");
  if (!disk.mounted()) GTEST_SKIP() << "only root may mount a tmpfs";
  Daemon daemon(folder, RealTime(SmallRig()), {.data = disk.data()});
  std::string run = daemon.StartRun({"light-stage", "--azimuths", "6", "--lamps", "0-14"});
  daemon.WaitForShots(run, 5);
  disk.Fill();
  Json paused = daemon.WaitForRun(run, "PAUSED");
  EXPECT_LT(paused["doneShots"].get<int>(), 90);
  EXPECT_EQ(paused["reason"]["reason"], "DISK_FULL") << paused["reason"];
  EXPECT_FALSE(Lit(daemon.State()));
  // Nothing half written is taken for good.
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  // Still full: paused again, nothing lost.
  ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
  EXPECT_TRUE(WaitUntil(Milliseconds(20000), [&] {
    return daemon.Run(run)["state"] == "RUN_STATE_PAUSED";
  })) << daemon.Run(run);
  disk.MakeRoom();
  ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
  Json done = daemon.WaitForRun(run, "SUCCEEDED");
  EXPECT_EQ(done["doneShots"], 90);
  Answer verify = daemon.Ctl({"runs", "verify", run});
  EXPECT_EQ(verify.code, 0) << verify.out;
  int temporary = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(daemon.RunFolder(run)))
    temporary += entry.path().extension() == ".tmp";
  EXPECT_EQ(temporary, 0);
}

// The state could not be written down either; after a crash the run is there all the same.
TEST(Disk, FullAndThenKilledIsResumed) {
  TestFolder folder;
  SmallDisk disk(folder, "80m");
  if (!disk.mounted()) GTEST_SKIP() << "only root may mount a tmpfs";
  std::string run, rig = RealTime(SmallRig());
  {
    Daemon daemon(folder, rig, {.data = disk.data()});
    run = daemon.StartRun({"light-stage", "--azimuths", "6", "--lamps", "0-14"});
    daemon.WaitForShots(run, 5);
    disk.Fill();
    daemon.WaitForRun(run, "PAUSED");
    daemon.Kill();
  }
  Daemon daemon(folder, rig, {.data = disk.data()});  // starts on the full disk
  EXPECT_EQ(daemon.Run(run)["state"], "RUN_STATE_INTERRUPTED");
  disk.MakeRoom();
  ASSERT_EQ(daemon.Ctl({"runs", "resume", run}).code, 0);
  EXPECT_EQ(daemon.WaitForRun(run, "SUCCEEDED")["doneShots"], 90);
  EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
}

}  // namespace
}  // namespace lightstage
