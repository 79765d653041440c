// The gRPC server: both services, standard health per subsystem, reflection.
#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/rpc/control.h"
#include "daemon/rpc/rig_service.h"
#include "daemon/rpc/run_service.h"
#include "grpcpp/server.h"

namespace lightstage::rpc {

// Health service names: "" and the two services' full names (always serving), "rig" (not serving while stopped), "store" (not
// serving while the disk is full).
class Server {
 public:
  // `addresses`: "unix:PATH" or "HOST:PORT"; port 0 picks one. A socket that a dead daemon left is removed; one that answers, or a
  // port in use, is FAILED_PRECONDITION / ADDRESS_IN_USE naming it. INVALID_ARGUMENT / ADDRESS_INVALID: not of that form, or
  // not loopback (there is no authentication yet).
  static absl::StatusOr<std::unique_ptr<Server>> Start(const std::vector<std::string>& addresses,
                                                       Rig& rig, const RigFacts& facts,
                                                       RunManager& runs);
  // Ends calls within seconds.
  ~Server();

  // Where it listens, with the real port.
  const std::vector<std::string>& addresses() const { return addresses_; }

 private:
  Server(Rig& rig, const RigFacts& facts, RunManager& runs);
  void WatchHealth();

  Rig& rig_;
  RunManager& runs_;
  RealClock wall_;  // leases live in wall time, whatever the rig's clock
  Control control_;
  RigService rig_service_;
  RunService run_service_;
  std::vector<std::string> addresses_;
  std::vector<std::string> sockets_;  // to be removed
  std::unique_ptr<grpc::Server> server_;
  std::atomic<bool> closed_{false};
  std::thread health_;
};

}  // namespace lightstage::rpc
