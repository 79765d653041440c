#include "sim/scenes/in_child.h"

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>

#include "absl/strings/str_cat.h"
#include "base/status.h"

namespace lightstage::sim {
namespace {

constexpr std::array kCrashes = {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL};
constexpr rlim_t kMostMemory = rlim_t{4} << 30;  // bytes
constexpr rlim_t kMostTime = 60;                 // s
// The answer's first byte, and its last: without that it is not whole.
constexpr char kDone = 'd', kFailed = 'f', kEnd = '.';

absl::Status Ended(const std::string& how) {
  return Error(absl::StatusCode::kAborted, "CHILD", how, {{"end", how}});
}

// Pages of this process, so that the limit is what the work takes besides (sanitizers reserve terabytes).
rlim_t OwnMemory() {
  long pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

[[noreturn]] void Child(pid_t parent, int to,
                        absl::FunctionRef<absl::StatusOr<std::string>()> work) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);     // it does not outlive its parent,
  if (::getppid() != parent) ::_exit(1);  // not even one that is gone already
  // What else is open here is not the child's: nobody waits for its end, and no bad file gets at it.
  ::close_range(3, static_cast<unsigned>(to) - 1, 0);
  ::close_range(static_cast<unsigned>(to) + 1, ~0U, 0);
  const rlim_t memory = OwnMemory() + kMostMemory;
  // Over the soft limit SIGXCPU comes, which says what it was.
  const rlimit space{memory, memory}, time{kMostTime, kMostTime + 5}, none{0, 0};
  ::setrlimit(RLIMIT_AS, &space);
  ::setrlimit(RLIMIT_CPU, &time);
  ::setrlimit(RLIMIT_CORE, &none);
  // What the process does at its end is not the child's to do.
  for (int signal : kCrashes) ::signal(signal, SIG_DFL);
  std::string answer(1, kFailed);
  try {
    absl::StatusOr<std::string> result = work();
    answer = result.ok() ? kDone + *std::move(result) : kFailed + MessageOf(result.status());
  } catch (const std::bad_alloc&) {
    answer += "takes more than 4 GiB of memory";
  }
  answer += kEnd;
  for (size_t done = 0; done < answer.size();) {
    const ssize_t n = ::write(to, answer.data() + done, answer.size() - done);
    if (n < 0 && errno != EINTR) break;
    if (n > 0) done += static_cast<size_t>(n);
  }
  ::_exit(0);
}

}  // namespace

absl::StatusOr<std::string> RunInChild(absl::FunctionRef<absl::StatusOr<std::string>()> work) {
  int ends[2];
  if (::pipe(ends) != 0) return ErrnoError(errno, "pipe", "to a child process");
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0) {
    const int why = errno;
    ::close(ends[0]);
    ::close(ends[1]);
    return ErrnoError(why, "fork", "a child process");
  }
  if (child == 0) {
    ::close(ends[0]);
    Child(parent, ends[1], work);
  }
  ::close(ends[1]);
  std::string answer;
  for (char chunk[1 << 16];;) {
    const ssize_t n = ::read(ends[0], chunk, sizeof(chunk));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    answer.append(chunk, static_cast<size_t>(n));
  }
  ::close(ends[0]);
  int status = 0;
  // If this process ignores its children's ends there is no status, and the answer alone says whether it is whole.
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    if (signal == SIGXCPU) return Ended("takes more than a minute of processor time");
    if (signal == SIGKILL) {
      return Ended("cannot be read: the importer was killed, by hand or for want of memory");
    }
    const bool crashed = std::find(kCrashes.begin(), kCrashes.end(), signal) != kCrashes.end();
    return Ended(absl::StrCat("cannot be read: the importer ",
                              crashed ? "crashed on it" : "was ended", " (", ::strsignal(signal),
                              ")"));
  }
  if (answer.size() < 2 || answer.back() != kEnd) {
    return Ended("cannot be read: the importer gave up without a word");
  }
  answer.pop_back();
  if (answer[0] == kFailed) return Ended(answer.substr(1));
  answer.erase(0, 1);
  return answer;
}

}  // namespace lightstage::sim
