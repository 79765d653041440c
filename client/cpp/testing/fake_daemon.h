// A daemon for client tests: both services in this process, over a real socket, on state that the
// test sets, with faults on demand. It has no rig and does nothing by itself.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "google/protobuf/message.h"
#include "grpcpp/server.h"
#include "grpcpp/support/status.h"
#include "lightstage/v1/rig.pb.h"
#include "lightstage/v1/run.pb.h"

namespace lightstage::client {

// What the daemon knows and does. Change it through FakeDaemon::Change().
struct FakeState {
  v1::Rig rig;
  v1::RigState rig_state;
  v1::EstimateRunResponse estimate;

  double heartbeat_seconds = 2;
  std::string token;   // empty: nobody has control
  std::string holder;  // with a holder and no token, somebody else has it
  std::string note;
  int renewals = 0;

  std::map<std::string, v1::Run>
      runs;  // by name; listed in reverse order, as newer names are greater
  std::map<std::string, std::vector<v1::Shot>> shots;
  std::map<std::string, std::map<std::string, std::string>> files;  // by run and path
  std::vector<v1::VerifyRunResponse> verify;
  std::string picture;  // what Snap takes

  // Every call, in order: the method's name and the request.
  std::vector<std::pair<std::string, std::shared_ptr<google::protobuf::Message>>> calls;

  // Faults.
  std::map<std::string, grpc::Status> refuse;  // by method: answered with this
  int answers_before_break = -1;  // the next stream breaks after so many answers; -1: it does not
  bool break_in_order = false;    // …as by a daemon that shuts down: ended, OK
  std::string corrupt_file;       // its first byte arrives with a flipped bit
  int files_per_page = 1000;
  int read_chunk = 1 << 20;
};

// A status as the real daemon sends it: with one google.rpc.ErrorInfo.
grpc::Status FakeError(grpc::StatusCode code, const std::string& reason, const std::string& message,
                       const std::map<std::string, std::string>& metadata = {});

class FakeDaemon {
 public:
  FakeDaemon();
  ~FakeDaemon();

  // Address to connect to: a Unix socket of its own.
  const std::string& address() const { return address_; }

  // A daemon that is gone, and is there again, with the same state.
  void Stop();
  void Start();

  void Change(const std::function<void(FakeState&)>& change);
  FakeState Snapshot() const;
  // The names of the methods called so far.
  std::vector<std::string> Calls() const;
  // The last request of a method. Fails the test if there was none.
  template <class Request>
  Request Last(const std::string& method) const {
    Request request;
    request.CopyFrom(LastRequest(method));
    return request;
  }
  // Waits at most 10 s for the state to be so.
  bool Eventually(const std::function<bool(const FakeState&)>& is_so) const;

 private:
  class Rig;
  class Runs;

  const google::protobuf::Message& LastRequest(const std::string& method) const;
  // Notes the call; the error it is to be refused with, if any.
  grpc::Status Enter(const std::string& method, const google::protobuf::Message& request);

  std::string folder_;
  std::string address_;
  mutable Mutex mutex_;
  CondVar changed_;
  FakeState state_ ABSL_GUARDED_BY(mutex_);
  uint64_t version_ ABSL_GUARDED_BY(mutex_) = 0;
  std::unique_ptr<Rig> rig_;
  std::unique_ptr<Runs> runs_;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace lightstage::client
