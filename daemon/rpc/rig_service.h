// lightstage.v1.RigService over one Rig. Every method may run on several threads at once.
#pragma once

#include <atomic>
#include <string>

#include "daemon/capture/rig_facts.h"
#include "daemon/rig/rig.h"
#include "daemon/rpc/control.h"
#include "daemon/runs/run_manager.h"
#include "lightstage/v1/rig.grpc.pb.h"

namespace lightstage::rpc {

class RigService final : public v1::RigService::Service {
 public:
  // All references outlive the service.
  RigService(Rig& rig, const RigFacts& facts, Control& control, RunManager& runs);

  // Ends watches, so that the server can shut down.
  void Close() { closed_ = true; }

  grpc::Status GetRig(grpc::ServerContext*, const v1::GetRigRequest*, v1::GetRigResponse*) override;
  grpc::Status GetRigState(grpc::ServerContext*, const v1::GetRigStateRequest*,
                           v1::GetRigStateResponse*) override;
  grpc::Status WatchRigState(grpc::ServerContext*, const v1::WatchRigStateRequest*,
                             grpc::ServerWriter<v1::WatchRigStateResponse>*) override;
  grpc::Status AcquireControl(grpc::ServerContext*, const v1::AcquireControlRequest*,
                              v1::AcquireControlResponse*) override;
  grpc::Status RenewControl(grpc::ServerContext*, const v1::RenewControlRequest*,
                            v1::RenewControlResponse*) override;
  grpc::Status ReleaseControl(grpc::ServerContext*, const v1::ReleaseControlRequest*,
                              v1::ReleaseControlResponse*) override;
  grpc::Status MoveAxis(grpc::ServerContext*, const v1::MoveAxisRequest*,
                        v1::MoveAxisResponse*) override;
  grpc::Status JogAxis(grpc::ServerContext*, const v1::JogAxisRequest*,
                       v1::JogAxisResponse*) override;
  grpc::Status SetLamps(grpc::ServerContext*, const v1::SetLampsRequest*,
                        v1::SetLampsResponse*) override;
  grpc::Status ShowPattern(grpc::ServerContext*, const v1::ShowPatternRequest*,
                           v1::ShowPatternResponse*) override;
  grpc::Status Snap(grpc::ServerContext*, const v1::SnapRequest*,
                    grpc::ServerWriter<v1::SnapResponse>*) override;
  grpc::Status StopRig(grpc::ServerContext*, const v1::StopRigRequest*,
                       v1::StopRigResponse*) override;
  grpc::Status ResetRig(grpc::ServerContext*, const v1::ResetRigRequest*,
                        v1::ResetRigResponse*) override;

 private:
  v1::RigState State();
  // Runs `operation` as the rig's manual user, with control.
  absl::Status Manually(const std::string& token, absl::FunctionRef<absl::Status()> operation);
  absl::Status ApplyLight(const Condition& condition);
  // The light that is on. FAILED_PRECONDITION / LIGHT_UNKNOWN if a device did not confirm what it was told last.
  absl::StatusOr<Condition> Light(bool with_lamps = true);

  Rig& rig_;
  const RigFacts& facts_;
  Control& control_;
  RunManager& runs_;
  std::atomic<bool> closed_{false};
};

}  // namespace lightstage::rpc
