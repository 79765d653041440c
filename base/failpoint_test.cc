#include "base/failpoint.h"

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

class FailpointTest : public ::testing::Test {
 protected:
  ~FailpointTest() override { EXPECT_TRUE(SetFailpoints("").ok()); }
};

TEST_F(FailpointTest, InactiveIsOk) { EXPECT_TRUE(Failpoint("store.journal").ok()); }

TEST_F(FailpointTest, ErrorAtTheNthHitOnly) {
  ASSERT_TRUE(SetFailpoints("a=error:2;b=error:1").ok());
  EXPECT_TRUE(Failpoint("a").ok());
  EXPECT_TRUE(Failpoint("c").ok());
  absl::Status hit = Failpoint("a");
  EXPECT_EQ(hit.code(), absl::StatusCode::kInternal);
  EXPECT_EQ(ErrorReason(hit), "FAILPOINT");
  EXPECT_TRUE(Failpoint("a").ok());
  EXPECT_FALSE(Failpoint("b").ok());
}

TEST_F(FailpointTest, BadSpecIsRefusedAndLeavesNothingActive) {
  for (const char* spec : {"a", "a=error", "a=error:0", "a=error:x", "a=stop:1", "=kill:1"}) {
    ASSERT_TRUE(SetFailpoints("b=error:1").ok());
    EXPECT_EQ(SetFailpoints(spec).code(), absl::StatusCode::kInvalidArgument) << spec;
    EXPECT_TRUE(Failpoint("b").ok()) << spec;
  }
}

TEST_F(FailpointTest, KillSendsSigkill) {
  pid_t child = ::fork();
  if (child == 0) {
    ::setenv("LIGHTSTAGED_FAILPOINTS", "a=kill:2", 1);
    bool ok = SetFailpointsFromEnvironment().ok() && Failpoint("a").ok();
    if (ok) Failpoint("a").IgnoreError();
    ::_exit(1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGKILL);
}

}  // namespace
}  // namespace lightstage
