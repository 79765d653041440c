#include <sys/ioctl.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "base/env.h"
#include "client/cli/app.h"
#include "client/cpp/canceller.h"
#include "spdlog/sinks/stdout_color_sinks.h"
#include "spdlog/spdlog.h"

namespace lightstage::client {
namespace {

sigset_t EndingSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGUSR1);  // wakes the thread that waits for the others
  return signals;
}

// Turns Ctrl-C and SIGTERM into Canceller::Cancel(), on a thread. A second one ends the process at
// once. The signals must be blocked in all threads.
class SignalWatch {
 public:
  explicit SignalWatch(Canceller& canceller)
      : thread_([this, &canceller] {
          sigset_t signals = EndingSignals();
          for (int count = 0;;) {
            int signal = 0;
            sigwait(&signals, &signal);
            if (quit_) return;
            if (signal == SIGUSR1) continue;
            if (++count > 1) _exit(static_cast<int>(ExitCode::kInterrupted));
            canceller.Cancel();
          }
        }) {}
  ~SignalWatch() {
    quit_ = true;
    pthread_kill(thread_.native_handle(), SIGUSR1);
    thread_.join();
  }

 private:
  std::atomic<bool> quit_{false};
  std::thread thread_;
};

int Columns() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

int Main(int argc, char** argv) {
  // Before any thread is there: they inherit it.
  sigset_t signals = EndingSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  // gRPC's own messages tell nothing that the commands do not say better. Set it to see them.
  setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);
  // Standard output is for answers only.
  spdlog::set_default_logger(spdlog::stderr_color_mt("lightstagectl"));
  spdlog::set_level(spdlog::level::warn);
  RealClock clock;
  Canceller interrupt(clock);
  SignalWatch watch(interrupt);
  World world{std::cout,
              std::cerr,
              isatty(STDIN_FILENO) != 0,
              isatty(STDERR_FILENO) != 0,
              Columns(),
              clock,
              PosixEnv(),
              interrupt};
  return static_cast<int>(RunCli(std::vector<std::string>(argv + 1, argv + argc), world));
}

}  // namespace
}  // namespace lightstage::client

int main(int argc, char** argv) { return lightstage::client::Main(argc, argv); }
