#include "tests/harness/process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "gtest/gtest.h"

namespace lightstage {

TestFolder::TestFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "lightstage-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) std::abort();
  path_ = name;
}

TestFolder::~TestFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string ReadText(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  EXPECT_TRUE(file.good()) << "cannot read " << path;
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

void WriteText(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << text;
  file.close();
  EXPECT_TRUE(file.good()) << "cannot write " << path;
}

void SleepFor(Milliseconds time) { std::this_thread::sleep_for(time); }

Process::Process(const std::vector<std::string>& arguments, const std::string& log,
                 const std::map<std::string, std::string>& environment)
    : log_(log) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) {
    command_ += argument + " ";
    argv.push_back(const_cast<char*>(argument.c_str()));
  }
  argv.push_back(nullptr);
  // Here and not in the child, so that they are there to be read from now on.
  int in_fd = open("/dev/null", O_RDONLY | O_CLOEXEC);
  int out_fd = open((log_ + ".out").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  int err_fd = open((log_ + ".err").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  EXPECT_TRUE(in_fd >= 0 && out_fd >= 0 && err_fd >= 0) << "cannot open " << log_;
  pid_t parent = getpid();
  pid_ = fork();
  if (pid_ != 0) {
    EXPECT_GT(pid_, 0) << "cannot fork";
    for (int fd : {in_fd, out_fd, err_fd}) close(fd);
    return;
  }
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(125);  // it ended before prctl
  dup2(in_fd, 0);
  dup2(out_fd, 1);
  dup2(err_fd, 2);
  for (const auto& [key, value] : environment) setenv(key.c_str(), value.c_str(), 1);
  execv(argv[0], argv.data());
  _exit(127);
}

Process::~Process() {
  if (!running()) return;
  kill(pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
}

void Process::Signal(int signal) const {
  if (!ended_) kill(pid_, signal);
}

bool Process::running() {
  if (ended_ || pid_ <= 0) return false;
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) == 0) return true;
  ended_ = true;
  code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return false;
}

int Process::Wait(Milliseconds patience) {
  auto end = std::chrono::steady_clock::now() + patience;
  while (running()) {
    if (std::chrono::steady_clock::now() > end) {
      ADD_FAILURE() << command_ << "did not end within " << patience.count() << " ms; " << err();
      Signal(SIGKILL);
      waitpid(pid_, nullptr, 0);
      ended_ = true;
      return code_;
    }
    SleepFor(Milliseconds(3));
  }
  return code_;
}

}  // namespace lightstage
