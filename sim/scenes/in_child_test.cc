#include "sim/scenes/in_child.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <memory>
#include <vector>

#include "base/status.h"

namespace lightstage::sim {
namespace {

TEST(InChild, AnswersComeBackWhole) {
  const std::string large(3 << 20, 'x');
  auto answer =
      RunInChild([&]() -> absl::StatusOr<std::string> { return large + std::string("\0!", 2); });
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(*answer, large + std::string("\0!", 2));
  EXPECT_EQ(*RunInChild([]() -> absl::StatusOr<std::string> { return std::string(); }), "");
}

TEST(InChild, ErrorsComeBackAsTheyWere) {
  auto answer = RunInChild([]() -> absl::StatusOr<std::string> {
    return Error(absl::StatusCode::kNotFound, "WHY", "line 3 is wrong");
  });
  EXPECT_EQ(MessageOf(answer.status()), "line 3 is wrong");
}

TEST(InChild, ACrashIsAnErrorHere) {
  int here = 1;
  auto answer = RunInChild([&]() -> absl::StatusOr<std::string> {
    here = 2;
    ::raise(SIGSEGV);
    return std::string("not reached");
  });
  EXPECT_NE(answer.status().message().find("crashed on it"), std::string::npos) << answer.status();
  EXPECT_EQ(here, 1) << "it works on a copy";
}

TEST(InChild, KilledIsNotTooSlow) {
  auto killed = RunInChild([]() -> absl::StatusOr<std::string> {
    ::raise(SIGKILL);
    return std::string("not reached");
  });
  EXPECT_NE(killed.status().message().find("was killed"), std::string::npos) << killed.status();
  auto slow = RunInChild([]() -> absl::StatusOr<std::string> {
    ::raise(SIGXCPU);
    return std::string("not reached");
  });
  EXPECT_NE(slow.status().message().find("a minute"), std::string::npos) << slow.status();
}

TEST(InChild, EndedByHandIsNoCrash) {
  auto ended = RunInChild([]() -> absl::StatusOr<std::string> {
    ::raise(SIGTERM);
    return std::string("not reached");
  });
  EXPECT_NE(ended.status().message().find("was ended (Terminated)"), std::string::npos)
      << ended.status();
}

// As a process has it whose parent did.
TEST(InChild, WorksWhereEndsOfChildrenAreIgnored) {
  auto* const before = ::signal(SIGCHLD, SIG_IGN);
  auto whole = RunInChild([]() -> absl::StatusOr<std::string> { return std::string("whole"); });
  auto crashed = RunInChild([]() -> absl::StatusOr<std::string> {
    ::raise(SIGSEGV);
    return std::string("not reached");
  });
  ::signal(SIGCHLD, before);
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_EQ(*whole, "whole");
  EXPECT_EQ(ErrorReason(crashed.status()), "CHILD") << crashed.status();
}

TEST(InChild, HoldsNothingOfOursOpen) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  auto answer = RunInChild([&]() -> absl::StatusOr<std::string> {
    return std::string(::fcntl(ends[0], F_GETFD) < 0 && ::fcntl(ends[1], F_GETFD) < 0 ? "closed"
                                                                                      : "open");
  });
  EXPECT_EQ(*answer, "closed");
  ::close(ends[0]);
  ::close(ends[1]);
}

TEST(InChild, MemoryIsLimited) {
  auto answer = RunInChild([]() -> absl::StatusOr<std::string> {
    std::vector<std::unique_ptr<char[]>> much;
    for (int i = 0; i < 6 * 16; ++i) {
      much.emplace_back(new char[size_t{64} << 20]);
      *static_cast<volatile char*>(much.back().get()) = 1;  // or it is optimised away
    }
    return std::string("6 GiB");
  });
  EXPECT_EQ(ErrorReason(answer.status()), "CHILD") << answer.status();
}

}  // namespace
}  // namespace lightstage::sim
