// lightstage.v1.RunService over the RunManager. Every method may run on several threads at once.
#pragma once

#include <atomic>

#include "daemon/capture/rig_facts.h"
#include "daemon/rpc/control.h"
#include "daemon/runs/run_manager.h"
#include "lightstage/v1/run.grpc.pb.h"

namespace lightstage::rpc {

class RunService final : public v1::RunService::Service {
 public:
  // All references outlive the service.
  RunService(RunManager& runs, const RigFacts& facts, Control& control);

  // Ends streams, so that the server can shut down.
  void Close() { closed_ = true; }

  grpc::Status EstimateRun(grpc::ServerContext*, const v1::EstimateRunRequest*,
                           v1::EstimateRunResponse*) override;
  grpc::Status StartRun(grpc::ServerContext*, const v1::StartRunRequest*,
                        v1::StartRunResponse*) override;
  grpc::Status GetRun(grpc::ServerContext*, const v1::GetRunRequest*, v1::GetRunResponse*) override;
  grpc::Status ListRuns(grpc::ServerContext*, const v1::ListRunsRequest*,
                        v1::ListRunsResponse*) override;
  grpc::Status PauseRun(grpc::ServerContext*, const v1::PauseRunRequest*,
                        v1::PauseRunResponse*) override;
  grpc::Status ResumeRun(grpc::ServerContext*, const v1::ResumeRunRequest*,
                         v1::ResumeRunResponse*) override;
  grpc::Status CancelRun(grpc::ServerContext*, const v1::CancelRunRequest*,
                         v1::CancelRunResponse*) override;
  grpc::Status WatchRun(grpc::ServerContext*, const v1::WatchRunRequest*,
                        grpc::ServerWriter<v1::WatchRunResponse>*) override;
  grpc::Status ListShots(grpc::ServerContext*, const v1::ListShotsRequest*,
                         v1::ListShotsResponse*) override;
  grpc::Status VerifyRun(grpc::ServerContext*, const v1::VerifyRunRequest*,
                         grpc::ServerWriter<v1::VerifyRunResponse>*) override;
  grpc::Status ListFiles(grpc::ServerContext*, const v1::ListFilesRequest*,
                         v1::ListFilesResponse*) override;
  grpc::Status ReadFile(grpc::ServerContext*, const v1::ReadFileRequest*,
                        grpc::ServerWriter<v1::ReadFileResponse>*) override;

 private:
  int lamp_count() const { return static_cast<int>(facts_.geometry.brace.lamps.size()); }
  // With control: does `change` to the run and tells how it is after it.
  absl::Status Change(const std::string& name, const std::string& token,
                      absl::Status (RunManager::*change)(const std::string&), v1::Run* after);
  absl::Status FillRun(const std::string& id, v1::Run* run);
  v1::Run ToMessage(const RunView& view) const;

  RunManager& runs_;
  const RigFacts& facts_;
  Control& control_;
  std::atomic<bool> closed_{false};
};

}  // namespace lightstage::rpc
