#include "sim/scenes/in_child.h"

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>

#include "absl/strings/str_cat.h"
#include "base/status.h"

namespace lightstage::sim {
namespace {

constexpr rlim_t kMostMemory = rlim_t{4} << 30;  // bytes
constexpr rlim_t kMostTime = 60;                 // s
constexpr char kDone = 'd', kFailed = 'f';       // the answer's first byte

absl::Status Ended(const std::string& how) {
  return Error(absl::StatusCode::kAborted, "CHILD", how, {{"end", how}});
}

// Pages of this process, so that the limit is what the work takes besides (sanitizers reserve terabytes).
rlim_t OwnMemory() {
  long pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

[[noreturn]] void Child(int to, absl::FunctionRef<absl::StatusOr<std::string>()> work) {
  const rlim_t memory = OwnMemory() + kMostMemory;
  const rlimit space{memory, memory}, time{kMostTime, kMostTime}, none{0, 0};
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // it does not outlive its parent
  ::setrlimit(RLIMIT_AS, &space);
  ::setrlimit(RLIMIT_CPU, &time);
  ::setrlimit(RLIMIT_CORE, &none);
  // What the process does at its end is not the child's to do.
  for (int signal : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL}) ::signal(signal, SIG_DFL);
  std::string answer(1, kFailed);
  try {
    absl::StatusOr<std::string> result = work();
    answer = result.ok() ? kDone + *std::move(result) : kFailed + MessageOf(result.status());
  } catch (const std::bad_alloc&) {
    answer += "takes more than 4 GiB of memory";
  }
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
  const pid_t child = ::fork();
  if (child < 0) {
    const int why = errno;
    ::close(ends[0]);
    ::close(ends[1]);
    return ErrnoError(why, "fork", "a child process");
  }
  if (child == 0) {
    ::close(ends[0]);
    Child(ends[1], work);
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
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    return Ended(signal == SIGXCPU || signal == SIGKILL
                     ? std::string("takes more than a minute of processor time")
                     : absl::StrCat("cannot be read: the importer crashed on it (",
                                    ::strsignal(signal), ")"));
  }
  if (answer.empty()) return Ended("cannot be read: the importer gave up without a word");
  if (answer[0] == kFailed) return Ended(answer.substr(1));
  answer.erase(0, 1);
  return answer;
}

}  // namespace lightstage::sim
