// What every command of lightstagectl works with: where it writes, whom it talks to, what the user
// said for all commands.
#pragma once

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/env.h"
#include "base/mutex.h"
#include "client/cpp/canceller.h"
#include "client/cpp/connection.h"
#include "client/cpp/control_lease.h"
#include "google/protobuf/message.h"

namespace lightstage::client {

enum class ExitCode {
  kOk = 0,
  kError = 1,          // the daemon or this machine refused or failed
  kUsage = 2,          // arguments, or a file given in them, cannot be read
  kNoConnection = 3,   // the daemon cannot be reached
  kRunNotDone = 4,     // the watched run is paused, interrupted, cancelled or failed
  kDamaged = 5,        // verify or fetch found damaged files
  kInterrupted = 130,  // by Ctrl-C; a started run goes on
};

// The process' surroundings, replaced in tests. All outlive the session.
struct World {
  std::ostream& out;  // answers
  std::ostream& err;  // errors, progress, hints
  bool in_is_terminal = false;
  bool err_is_terminal = false;
  int columns = 80;  // of the terminal
  Clock& clock;
  Env& env;
  Canceller& interrupt;  // Ctrl-C
};

// Options that every command takes.
struct GlobalOptions {
  std::string address;
  bool json = false;
  double wait_seconds = 0;
  std::string owner;
  std::string note;
};

class Session {
 public:
  Session(World& world, GlobalOptions options) : world_(world), options_(std::move(options)) {}

  World& world() { return world_; }
  const GlobalOptions& options() const { return options_; }
  bool json() const { return options_.json; }

  // Connects at the first use. The connection lives as long as the session.
  absl::StatusOr<Connection*> Connect();

  // Takes control with the user's owner and note. If it is lost later, everything is interrupted
  // and lost_control() says why. To be destroyed before the session.
  absl::StatusOr<std::unique_ptr<ControlLease>> TakeControl();
  absl::Status lost_control() const;

  // Writes an answer: as one JSON line, or as text.
  absl::Status Print(const google::protobuf::Message& message,
                     absl::FunctionRef<std::string()> text);

  // A command line of lightstagectl that the user can copy.
  std::string CommandLine(const std::string& command) const;

 private:
  World& world_;
  const GlobalOptions options_;
  std::unique_ptr<Connection> connection_;
  mutable Mutex mutex_;
  absl::Status lost_control_ ABSL_GUARDED_BY(mutex_);
};

// A command that was chosen and whose own arguments were read.
using Command = std::function<absl::StatusOr<ExitCode>(Session&)>;

// "anna@lab3 (4711)": user, host and process.
std::string DefaultOwner();

}  // namespace lightstage::client
