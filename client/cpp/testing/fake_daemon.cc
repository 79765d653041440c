#include "client/cpp/testing/fake_daemon.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "base/strings.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server_builder.h"
#include "lightstage/v1/rig.grpc.pb.h"
#include "lightstage/v1/run.grpc.pb.h"
#include "openssl/sha.h"

namespace lightstage::client {
namespace {

void Require(bool so, const char* what) {
  if (so) return;
  std::fprintf(stderr, "fake daemon: %s failed or never happened\n", what);
  std::abort();
}

std::string Sha256Hex(const std::string& bytes) {
  unsigned char digest[SHA256_DIGEST_LENGTH];
  SHA256(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(), digest);
  return absl::BytesToHexString(
      absl::string_view(reinterpret_cast<char*>(digest), SHA256_DIGEST_LENGTH));
}

grpc::Status NoRun(const std::string& name) {
  return FakeError(grpc::StatusCode::NOT_FOUND, "RUN_NOT_FOUND", "there is no run " + name,
                   {{"run", name}});
}

grpc::Status CheckToken(const FakeState& state, const std::string& token) {
  if (!token.empty() && token == state.token) return grpc::Status::OK;
  return FakeError(grpc::StatusCode::FAILED_PRECONDITION, "CONTROL_LOST",
                   "this client has no control of the rig");
}

bool Ended(const v1::Run& run) {
  return run.state() == v1::RUN_STATE_SUCCEEDED || run.state() == v1::RUN_STATE_FAILED ||
         run.state() == v1::RUN_STATE_CANCELLED || run.state() == v1::RUN_STATE_INTERRUPTED;
}

}  // namespace

grpc::Status FakeError(grpc::StatusCode code, const std::string& reason, const std::string& message,
                       const std::map<std::string, std::string>& metadata) {
  google::rpc::ErrorInfo info;
  info.set_reason(reason);
  info.set_domain("lightstaged");
  for (const auto& [key, value] : metadata) (*info.mutable_metadata())[key] = value;
  google::rpc::Status status;
  status.set_code(code);
  status.set_message(message);
  status.add_details()->PackFrom(info);
  return grpc::Status(code, message, status.SerializeAsString());
}

class FakeDaemon::Rig final : public v1::RigService::Service {
 public:
  explicit Rig(FakeDaemon& daemon) : d_(daemon) {}

  grpc::Status GetRig(grpc::ServerContext*, const v1::GetRigRequest* q,
                      v1::GetRigResponse* a) override {
    return Answer("GetRig", *q, [&](FakeState& s) {
      *a->mutable_rig() = s.rig;
      return grpc::Status::OK;
    });
  }
  grpc::Status GetRigState(grpc::ServerContext*, const v1::GetRigStateRequest* q,
                           v1::GetRigStateResponse* a) override {
    return Answer("GetRigState", *q, [&](FakeState& s) {
      *a->mutable_state() = s.rig_state;
      return grpc::Status::OK;
    });
  }
  grpc::Status AcquireControl(grpc::ServerContext*, const v1::AcquireControlRequest* q,
                              v1::AcquireControlResponse* a) override {
    return Answer("AcquireControl", *q, [&](FakeState& s) {
      if (!s.holder.empty()) {
        return FakeError(grpc::StatusCode::FAILED_PRECONDITION, "CONTROL_HELD",
                         "control is held by " + s.holder, {{"owner", s.holder}});
      }
      s.holder = q->owner();
      s.note = q->note();
      s.token = "token of " + q->owner();
      a->set_control_token(s.token);
      a->set_heartbeat_seconds(s.heartbeat_seconds);
      return grpc::Status::OK;
    });
  }
  grpc::Status RenewControl(grpc::ServerContext*, const v1::RenewControlRequest* q,
                            v1::RenewControlResponse*) override {
    return Controlled("RenewControl", *q, [&](FakeState& s) { ++s.renewals; });
  }
  grpc::Status ReleaseControl(grpc::ServerContext*, const v1::ReleaseControlRequest* q,
                              v1::ReleaseControlResponse*) override {
    return Controlled("ReleaseControl", *q, [&](FakeState& s) {
      s.token.clear();
      s.holder.clear();
      s.rig_state.clear_lamps();
      s.rig_state.clear_pattern();
    });
  }
  grpc::Status MoveAxis(grpc::ServerContext*, const v1::MoveAxisRequest* q,
                        v1::MoveAxisResponse* a) override {
    return Controlled("MoveAxis", *q, [&](FakeState&) {
      a->mutable_axis()->set_axis(q->axis());
      a->mutable_axis()->set_position_deg(q->target_deg());
      a->mutable_axis()->set_homed(true);
    });
  }
  grpc::Status JogAxis(grpc::ServerContext* context, const v1::JogAxisRequest* q,
                       v1::JogAxisResponse* a) override {
    grpc::Status status = Controlled("JogAxis", *q, [&](FakeState&) {
      a->mutable_axis()->set_axis(q->axis());
      a->mutable_axis()->set_position_deg(q->velocity_dps() * q->seconds());
    });
    // As long as it says, or until the call is ended.
    for (double s = 0; status.ok() && s < q->seconds() && !context->IsCancelled(); s += 0.01) {
      usleep(10000);
    }
    return status;
  }
  grpc::Status SetLamps(grpc::ServerContext*, const v1::SetLampsRequest* q,
                        v1::SetLampsResponse* a) override {
    return Controlled("SetLamps", *q, [&](FakeState& s) {
      *s.rig_state.mutable_lamps() = q->lamps();
      *a->mutable_lamps() = q->lamps();
    });
  }
  grpc::Status ShowPattern(grpc::ServerContext*, const v1::ShowPatternRequest* q,
                           v1::ShowPatternResponse* a) override {
    return Controlled("ShowPattern", *q, [&](FakeState& s) {
      *s.rig_state.mutable_pattern() = q->pattern();
      *a->mutable_pattern() = q->pattern();
    });
  }
  grpc::Status Snap(grpc::ServerContext*, const v1::SnapRequest* q,
                    grpc::ServerWriter<v1::SnapResponse>* writer) override {
    std::string picture;
    size_t chunk = 0;
    grpc::Status status = Controlled("Snap", *q, [&](FakeState& s) {
      picture = s.picture;
      chunk = static_cast<size_t>(s.read_chunk);
    });
    for (size_t at = 0; status.ok() && at < picture.size(); at += chunk) {
      v1::SnapResponse part;
      part.set_total_bytes(static_cast<int64_t>(picture.size()));
      part.set_data(picture.substr(at, chunk));
      if (at == 0) {  // the real one says these once, too
        part.set_black_share(0.25);
        for (double asked : q->exposures_us()) {
          v1::Exposure* exposure = part.add_exposures();
          exposure->set_requested_us(asked);
          exposure->set_used_us(std::floor(asked / 1000) * 1000);
        }
      }
      writer->Write(part);
    }
    return status;
  }
  grpc::Status StopRig(grpc::ServerContext*, const v1::StopRigRequest* q,
                       v1::StopRigResponse* a) override {
    return Answer("StopRig", *q, [&](FakeState& s) {
      s.rig_state.set_activity(v1::RIG_ACTIVITY_STOPPED);
      *a->mutable_state() = s.rig_state;
      return grpc::Status::OK;
    });
  }
  grpc::Status ResetRig(grpc::ServerContext*, const v1::ResetRigRequest* q,
                        v1::ResetRigResponse* a) override {
    return Controlled("ResetRig", *q, [&](FakeState& s) {
      s.rig_state.set_activity(v1::RIG_ACTIVITY_IDLE);
      *a->mutable_state() = s.rig_state;
    });
  }

 private:
  template <class Request>
  grpc::Status Answer(const std::string& method, const Request& request,
                      const std::function<grpc::Status(FakeState&)>& answer) {
    if (grpc::Status status = d_.Enter(method, request); !status.ok()) return status;
    MutexLock lock(&d_.mutex_);
    return answer(d_.state_);
  }
  template <class Request>
  grpc::Status Controlled(const std::string& method, const Request& request,
                          const std::function<void(FakeState&)>& act) {
    if (grpc::Status status = d_.Enter(method, request); !status.ok()) return status;
    MutexLock lock(&d_.mutex_);
    grpc::Status status = CheckToken(d_.state_, request.control_token());
    if (status.ok()) act(d_.state_);
    return status;
  }

  FakeDaemon& d_;
};

class FakeDaemon::Runs final : public v1::RunService::Service {
 public:
  explicit Runs(FakeDaemon& daemon) : d_(daemon) {}

  grpc::Status EstimateRun(grpc::ServerContext*, const v1::EstimateRunRequest* q,
                           v1::EstimateRunResponse* a) override {
    if (grpc::Status status = d_.Enter("EstimateRun", *q); !status.ok()) return status;
    MutexLock lock(&d_.mutex_);
    *a = d_.state_.estimate;
    return grpc::Status::OK;
  }
  grpc::Status StartRun(grpc::ServerContext*, const v1::StartRunRequest* q,
                        v1::StartRunResponse* a) override {
    if (grpc::Status status = d_.Enter("StartRun", *q); !status.ok()) return status;
    MutexLock lock(&d_.mutex_);
    if (grpc::Status status = CheckToken(d_.state_, q->control_token()); !status.ok())
      return status;
    std::string name = absl::StrCat("runs/r", d_.state_.runs.size() + 1);
    v1::Run& run = d_.state_.runs[name];
    run.set_name(name);
    run.set_display_name(q->display_name());
    *run.mutable_plan() = q->plan();
    run.set_state(v1::RUN_STATE_RUNNING);
    run.set_total_shots(d_.state_.estimate.shots());
    *a->mutable_run() = run;
    return grpc::Status::OK;
  }
  grpc::Status GetRun(grpc::ServerContext*, const v1::GetRunRequest* q,
                      v1::GetRunResponse* a) override {
    return WithRun("GetRun", *q, [&](FakeState&, v1::Run& run) {
      *a->mutable_run() = run;
      return grpc::Status::OK;
    });
  }
  grpc::Status ListRuns(grpc::ServerContext*, const v1::ListRunsRequest* q,
                        v1::ListRunsResponse* a) override {
    if (grpc::Status status = d_.Enter("ListRuns", *q); !status.ok()) return status;
    MutexLock lock(&d_.mutex_);
    std::vector<const v1::Run*> all;
    for (const auto& [name, run] : d_.state_.runs) all.insert(all.begin(), &run);
    size_t from = q->page_token().empty() ? 0 : std::stoul(q->page_token());
    size_t to = std::min(all.size(), from + (q->page_size() > 0 ? q->page_size() : 100));
    for (size_t i = from; i < to; ++i) *a->add_runs() = *all[i];
    if (to < all.size()) a->set_next_page_token(std::to_string(to));
    return grpc::Status::OK;
  }
  grpc::Status PauseRun(grpc::ServerContext*, const v1::PauseRunRequest* q,
                        v1::PauseRunResponse* a) override {
    return Steer("PauseRun", *q, v1::RUN_STATE_PAUSED, a);
  }
  grpc::Status ResumeRun(grpc::ServerContext*, const v1::ResumeRunRequest* q,
                         v1::ResumeRunResponse* a) override {
    return Steer("ResumeRun", *q, v1::RUN_STATE_RUNNING, a);
  }
  grpc::Status CancelRun(grpc::ServerContext*, const v1::CancelRunRequest* q,
                         v1::CancelRunResponse* a) override {
    return Steer("CancelRun", *q, v1::RUN_STATE_CANCELLED, a);
  }

  grpc::Status WatchRun(grpc::ServerContext* context, const v1::WatchRunRequest* q,
                        grpc::ServerWriter<v1::WatchRunResponse>* writer) override {
    if (grpc::Status status = d_.Enter("WatchRun", *q); !status.ok()) return status;
    size_t sent = static_cast<size_t>(q->shots_from());
    uint64_t seen = 0;
    for (;;) {
      v1::WatchRunResponse response;
      {
        MutexLock lock(&d_.mutex_);
        while (d_.version_ == seen && !context->IsCancelled()) {
          d_.changed_.WaitFor(&d_.mutex_, std::chrono::milliseconds(10));
        }
        if (context->IsCancelled()) return grpc::Status::CANCELLED;
        seen = d_.version_;
        auto run = d_.state_.runs.find(q->name());
        if (run == d_.state_.runs.end()) return NoRun(q->name());
        *response.mutable_run() = run->second;
        const auto& shots = d_.state_.shots[q->name()];
        for (; q->has_shots_from() && sent < shots.size(); ++sent) {
          *response.add_shots() = shots[sent];
        }
        if (q->has_shots_from()) response.set_next_shots_from(static_cast<int>(sent));
        if (std::optional<grpc::Status> broken = BreakNow()) return *broken;
      }
      writer->Write(response);
      if (Ended(response.run())) return grpc::Status::OK;
    }
  }

  grpc::Status VerifyRun(grpc::ServerContext*, const v1::VerifyRunRequest* q,
                         grpc::ServerWriter<v1::VerifyRunResponse>* writer) override {
    std::vector<v1::VerifyRunResponse> answers;
    grpc::Status status = WithRun("VerifyRun", *q, [&](FakeState& s, v1::Run&) {
      answers = s.verify;
      return grpc::Status::OK;
    });
    for (const auto& answer : answers) writer->Write(answer);
    return status;
  }

  grpc::Status ListFiles(grpc::ServerContext*, const v1::ListFilesRequest* q,
                         v1::ListFilesResponse* a) override {
    if (grpc::Status status = d_.Enter("ListFiles", *q); !status.ok()) return status;
    MutexLock lock(&d_.mutex_);
    auto run = d_.state_.files.find(q->parent());
    if (run == d_.state_.files.end()) return NoRun(q->parent());
    for (const auto& [path, bytes] : run->second) {
      if (!q->page_token().empty() && path <= q->page_token()) continue;
      if (a->files_size() == d_.state_.files_per_page) {
        a->set_next_page_token(a->files().rbegin()->path());
        break;
      }
      v1::DatasetFile* file = a->add_files();
      file->set_path(path);
      file->set_bytes(static_cast<int64_t>(bytes.size()));
      if (absl::EndsWith(path, ".exr")) file->set_sha256(Sha256Hex(bytes));
    }
    return grpc::Status::OK;
  }

  grpc::Status ReadFile(grpc::ServerContext*, const v1::ReadFileRequest* q,
                        grpc::ServerWriter<v1::ReadFileResponse>* writer) override {
    if (grpc::Status status = d_.Enter("ReadFile", *q); !status.ok()) return status;
    std::string bytes;
    size_t chunk = 0;
    {
      MutexLock lock(&d_.mutex_);
      bytes = d_.state_.files[q->name()][q->path()];
      chunk = static_cast<size_t>(d_.state_.read_chunk);
      if (d_.state_.corrupt_file == q->path()) bytes.at(0) ^= 1;
    }
    for (size_t at = static_cast<size_t>(q->offset()); at < bytes.size(); at += chunk) {
      {
        MutexLock lock(&d_.mutex_);
        if (std::optional<grpc::Status> broken = BreakNow()) return *broken;
      }
      v1::ReadFileResponse part;
      part.set_total_bytes(static_cast<int64_t>(bytes.size()));
      part.set_data(bytes.substr(at, chunk));
      writer->Write(part);
    }
    return grpc::Status::OK;
  }

 private:
  std::optional<grpc::Status> BreakNow() ABSL_EXCLUSIVE_LOCKS_REQUIRED(d_.mutex_) {
    if (d_.state_.answers_before_break < 0 || d_.state_.answers_before_break-- > 0) return {};
    return d_.state_.break_in_order ? grpc::Status::OK
                                    : grpc::Status(grpc::StatusCode::UNAVAILABLE, "Socket closed");
  }

  template <class Request>
  grpc::Status WithRun(const std::string& method, const Request& request,
                       const std::function<grpc::Status(FakeState&, v1::Run&)>& act) {
    if (grpc::Status status = d_.Enter(method, request); !status.ok()) return status;
    MutexLock lock(&d_.mutex_);
    auto run = d_.state_.runs.find(request.name());
    if (run == d_.state_.runs.end()) return NoRun(request.name());
    return act(d_.state_, run->second);
  }
  template <class Request, class Response>
  grpc::Status Steer(const std::string& method, const Request& request, v1::RunState to,
                     Response* response) {
    grpc::Status status = WithRun(method, request, [&](FakeState& s, v1::Run& run) {
      grpc::Status allowed = CheckToken(s, request.control_token());
      if (!allowed.ok()) return allowed;
      run.set_state(to);
      *response->mutable_run() = run;
      return grpc::Status::OK;
    });
    d_.Change([](FakeState&) {});
    return status;
  }

  FakeDaemon& d_;
};

FakeDaemon::FakeDaemon() {
  char folder[] = "/tmp/lightstage-test-XXXXXX";
  Require(mkdtemp(folder) != nullptr, "mkdtemp");
  folder_ = folder;
  address_ = absl::StrCat("unix:", folder_, "/socket");
  Start();
}

FakeDaemon::~FakeDaemon() {
  Stop();
  std::filesystem::remove_all(folder_);
}

void FakeDaemon::Start() {
  rig_ = std::make_unique<Rig>(*this);
  runs_ = std::make_unique<Runs>(*this);
  {
    MutexLock lock(&mutex_);
    ++version_;
  }
  grpc::ServerBuilder builder;
  builder.AddListeningPort(address_, grpc::InsecureServerCredentials());
  builder.RegisterService(rig_.get());
  builder.RegisterService(runs_.get());
  server_ = builder.BuildAndStart();
  Require(server_ != nullptr, "listening");
}

void FakeDaemon::Stop() {
  if (server_ == nullptr) return;
  server_->Shutdown(std::chrono::system_clock::now());
  server_.reset();
}

void FakeDaemon::Change(const std::function<void(FakeState&)>& change) {
  MutexLock lock(&mutex_);
  change(state_);
  ++version_;
  changed_.SignalAll();
}

FakeState FakeDaemon::Snapshot() const {
  MutexLock lock(&mutex_);
  return state_;
}

std::vector<std::string> FakeDaemon::Calls() const {
  std::vector<std::string> names;
  for (const auto& call : Snapshot().calls) names.push_back(call.first);
  return names;
}

const google::protobuf::Message& FakeDaemon::LastRequest(const std::string& method) const {
  MutexLock lock(&mutex_);
  auto call = std::find_if(state_.calls.rbegin(), state_.calls.rend(),
                           [&](const auto& c) { return c.first == method; });
  Require(call != state_.calls.rend(), method.c_str());
  return *call->second;
}

bool FakeDaemon::Eventually(const std::function<bool(const FakeState&)>& is_so) const {
  for (int i = 0; i < 1000; ++i) {
    if (is_so(Snapshot())) return true;
    usleep(10000);
  }
  return false;
}

grpc::Status FakeDaemon::Enter(const std::string& method,
                               const google::protobuf::Message& request) {
  MutexLock lock(&mutex_);
  std::shared_ptr<google::protobuf::Message> copy(request.New());
  copy->CopyFrom(request);
  state_.calls.emplace_back(method, std::move(copy));
  auto refusal = state_.refuse.find(method);
  return refusal == state_.refuse.end() ? grpc::Status::OK : refusal->second;
}

}  // namespace lightstage::client
