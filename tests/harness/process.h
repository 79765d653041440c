// Programs run as a user would run them, and folders for them to work in.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace lightstage {

using Milliseconds = std::chrono::milliseconds;

// Removed with all that is in it. Short, so that a socket's path fits.
class TestFolder {
 public:
  TestFolder();
  ~TestFolder();
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

std::string ReadText(const std::filesystem::path& path);  // fails the test if it cannot
void WriteText(const std::filesystem::path& path, const std::string& text);

// Tries `done` until it is true; false after `patience`.
template <class Done>
bool WaitUntil(Milliseconds patience, Done done);

// A child process. It ends with this object, and with the test's process however that ends.
class Process {
 public:
  // `log` is the path that its output is written to: <log>.out and <log>.err.
  Process(const std::vector<std::string>& arguments, const std::string& log,
          const std::map<std::string, std::string>& environment = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal) const;
  bool running();
  // Its exit code, or 128 + the signal that killed it. After `patience` the test fails and it is killed.
  int Wait(Milliseconds patience = Milliseconds(60000));
  std::string out() const { return ReadText(log_ + ".out"); }
  std::string err() const { return ReadText(log_ + ".err"); }

 private:
  std::string log_, command_;
  pid_t pid_ = -1;
  int code_ = -1;
  bool ended_ = false;
};

void SleepFor(Milliseconds time);

template <class Done>
bool WaitUntil(Milliseconds patience, Done done) {
  auto end = std::chrono::steady_clock::now() + patience;
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    SleepFor(Milliseconds(10));
  }
  return true;
}

}  // namespace lightstage
