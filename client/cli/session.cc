#include "client/cli/session.h"

#include <pwd.h>
#include <unistd.h>

#include <utility>

#include "base/status.h"
#include "base/strings.h"
#include "client/cli/messages.h"

namespace lightstage::client {

absl::StatusOr<Connection*> Session::Connect() {
  if (connection_ == nullptr) {
    ASSIGN_OR_RETURN(connection_, client::Connect(options_.address, world_.clock, world_.interrupt,
                                                  FromSeconds(options_.wait_seconds)));
  }
  return connection_.get();
}

absl::StatusOr<std::unique_ptr<ControlLease>> Session::TakeControl() {
  ASSIGN_OR_RETURN(Connection * connection, Connect());
  return ControlLease::Acquire(*connection, options_.owner, options_.note, world_.interrupt,
                               [this](const absl::Status& why) {
                                 {
                                   MutexLock lock(&mutex_);
                                   lost_control_ = why;
                                 }
                                 world_.interrupt.Cancel();
                               });
}

absl::Status Session::lost_control() const {
  MutexLock lock(&mutex_);
  return lost_control_;
}

absl::Status Session::Print(const google::protobuf::Message& message,
                            absl::FunctionRef<std::string()> text) {
  if (options_.json) {
    ASSIGN_OR_RETURN(std::string line, ToJsonLine(message));
    world_.out << line;
  } else {
    world_.out << text();
  }
  world_.out.flush();
  if (world_.out.good()) return absl::OkStatus();
  return Error(absl::StatusCode::kInternal, "OUTPUT_FAILED", "cannot write to standard output");
}

std::string Session::CommandLine(const std::string& command) const {
  std::string line = "lightstagectl ";
  if (options_.address != DefaultAddress()) {
    absl::StrAppend(&line, "--address ", options_.address, " ");
  }
  return line + command;
}

std::string DefaultOwner() {
  const passwd* user = getpwuid(geteuid());
  char host[256] = "";
  gethostname(host, sizeof(host) - 1);
  return absl::StrCat(user != nullptr ? user->pw_name : absl::StrCat("uid ", geteuid()), "@", host,
                      " (", getpid(), ")");
}

}  // namespace lightstage::client
