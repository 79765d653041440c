// kill -9 at every named point of the way of a shot to disk; then the run goes on, and ends as if nothing had happened.
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <map>

#include "base/failpoint.h"
#include "base/status.h"
#include "daemon/store/finish.h"
#include "daemon/store/test_run.h"
#include "daemon/store/verify.h"
#include "dataset/manifest.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

using ::testing::IsEmpty;

const WallTime kNow = ParseUtc("2004-05-06T07:08:09Z").value();
constexpr uint64_t kShots = 24;

// Captures what is missing and finishes.
void Complete(RunFolder& run) {
  ASSERT_TRUE(run.PrepareToAppend().ok());
  {
    Outcomes outcomes;
    Pipeline pipeline(run, TestDevelop, {.workers = 2, .queue_shots = 4}, outcomes.fn());
    for (uint64_t id = 0; id < kShots; ++id) {
      if (!run.HasRecord(id)) PutPatiently(pipeline, TestShot(id));
    }
    pipeline.Drain();
  }
  ASSERT_TRUE(Finish(run).ok());
  ASSERT_TRUE(run.AppendState(RunState::kSucceeded, absl::OkStatus(), kNow).ok());
}

// Every file but the journal, whose order is the order of storing.
std::map<std::string, std::string> Files(const RunFolder& run) {
  std::map<std::string, std::string> files;
  for (const FolderFile& file : run.ListFiles().value_or(std::vector<FolderFile>())) {
    if (file.path != "journal")
      files[file.path] = run.env().ReadFile(run.path() + "/" + file.path).value();
  }
  return files;
}

class CrashTest : public ::testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(
    Points, CrashTest,
    ::testing::Values("env.before_rename=kill:4", "env.before_rename=kill:17",
                      "store.after_rename=kill:1", "store.after_rename=kill:13",
                      "store.before_journal_append=kill:1", "store.before_journal_append=kill:3",
                      "store.after_journal_append=kill:1", "store.after_journal_append=kill:3",
                      "store.after_journal_sync=kill:1", "store.after_journal_sync=kill:3",
                      "env.before_rename=kill:28", "env.before_rename=kill:29"));

TEST_P(CrashTest, NothingIsLostAndNothingTwice) {
  TemporaryDirectory whole_dir, crashed_dir;
  auto whole_data = DataDirectory::Open(PosixEnv(), whole_dir.path()).value();
  auto whole = whole_data->CreateRun(TestHeader(kShots), "rig", kNow).value();
  Complete(*whole);

  // The child writes down what it was told is stored.
  int told[2];
  ASSERT_EQ(::pipe(told), 0);
  pid_t child = ::fork();
  if (child == 0) {
    if (!SetFailpoints(GetParam()).ok()) ::_exit(2);
    auto data = DataDirectory::Open(PosixEnv(), crashed_dir.path()).value();
    auto run = data->CreateRun(TestHeader(kShots), "rig", kNow).value();
    {
      Pipeline pipeline(*run, TestDevelop, {.workers = 1, .queue_shots = 2},
                        [&](ShotOutcome outcome) {
                          auto id = static_cast<uint8_t>(outcome.shot_id);
                          if (outcome.record.ok() && ::write(told[1], &id, 1) != 1) ::_exit(3);
                        });
      for (uint64_t id = 0; id < kShots; ++id) PutPatiently(pipeline, TestShot(id));
    }
    if (!Finish(*run).ok()) ::_exit(4);
    ::_exit(0);
  }
  ::close(told[1]);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status)) << "the point was not reached: " << status;
  ASSERT_EQ(WTERMSIG(status), SIGKILL);

  auto data = DataDirectory::Open(PosixEnv(), crashed_dir.path()).value();
  std::vector<std::string> ids = data->ListRuns().value();
  ASSERT_EQ(ids.size(), 1u);
  auto run = data->OpenRun(ids[0]).value();
  EXPECT_EQ(run->state().state, RunState::kInterrupted);
  EXPECT_TRUE(run->damage().ok());
  uint8_t id;
  while (::read(told[0], &id, 1) == 1) EXPECT_TRUE(run->HasRecord(id)) << int{id};
  ::close(told[0]);

  Complete(*run);
  run = data->OpenRun(ids[0]).value();
  EXPECT_EQ(run->count(), kShots);
  EXPECT_THAT(Verify(*run, {}).value(), IsEmpty());
  EXPECT_TRUE(Files(*run) == Files(*whole));
}

}  // namespace
}  // namespace lightstage
