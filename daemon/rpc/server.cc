#include "daemon/rpc/server.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "base/status.h"
#include "daemon/store/room.h"
#include "grpc/grpc.h"
#include "grpcpp/ext/proto_server_reflection_plugin.h"
#include "grpcpp/health_check_service_interface.h"
#include "grpcpp/server_builder.h"
#include "spdlog/spdlog.h"

namespace lightstage::rpc {
namespace {

absl::Status AddressInUse(const std::string& address, std::string_view why) {
  return Error(absl::StatusCode::kFailedPrecondition, "ADDRESS_IN_USE",
               absl::StrFormat("cannot listen on %s: %s", address, std::string(why)),
               {{"address", address}});
}

absl::Status AddressInvalid(const std::string& address, std::string_view right) {
  return Error(absl::StatusCode::kInvalidArgument, "ADDRESS_INVALID",
               absl::StrFormat("cannot listen on '%s': %s", address, std::string(right)),
               {{"address", address}});
}

// Removes a socket that nobody listens on any more.
absl::Status ClearSocket(const std::string& address, const std::string& path) {
  sockaddr_un name{};
  if (path.empty() || path.size() >= sizeof(name.sun_path)) {
    return AddressInvalid(address, absl::StrFormat("a socket's path has 1 to %d characters",
                                                   sizeof(name.sun_path) - 1));
  }
  struct stat there {};
  if (lstat(path.c_str(), &there) != 0) {
    if (errno != ENOENT) return ErrnoError(errno, "stat", path);
    std::filesystem::path folder = std::filesystem::path(path).parent_path();
    if (folder.empty() || access(folder.c_str(), F_OK) == 0) return absl::OkStatus();
    return AddressInvalid(address, absl::StrCat("there is no folder ", folder.string()));
  }
  // Before connecting: Linux refuses a connection to any file alike.
  if (!S_ISSOCK(there.st_mode))
    return AddressInUse(address, "there is a file of that name that is not a socket");
  name.sun_family = AF_UNIX;
  std::memcpy(name.sun_path, path.data(), path.size());
  int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return ErrnoError(errno, "socket", path);
  int connected = connect(fd, reinterpret_cast<sockaddr*>(&name), sizeof(name));
  int error = errno;
  close(fd);
  if (connected == 0) return AddressInUse(address, "another program is listening there");
  if (error != ECONNREFUSED) return ErrnoError(error, "connect to", path);
  spdlog::info("removing {}, which a dead process left", path);
  if (unlink(path.c_str()) != 0) return ErrnoError(errno, "remove", path);
  return absl::OkStatus();
}

absl::Status CheckTcp(const std::string& address) {
  size_t colon = address.rfind(':');
  int port = -1;
  if (colon == std::string::npos || !absl::SimpleAtoi(address.substr(colon + 1), &port) ||
      port < 0 || port > 65535) {
    return AddressInvalid(address, "unix:PATH, 127.0.0.1:PORT or [::1]:PORT is needed");
  }
  std::string host = address.substr(0, colon);
  if (host == "localhost" || host == "[::1]" || absl::StartsWith(host, "127."))
    return absl::OkStatus();
  return AddressInvalid(address,
                        "only loopback is served, because callers are not authenticated; use a "
                        "tunnel to reach it from elsewhere");
}

}  // namespace

Server::Server(Rig& rig, const RigFacts& facts, RunManager& runs)
    : rig_(rig),
      runs_(runs),
      control_(wall_, rig.file().engine.heartbeat,
               [this](std::string_view) {
                 absl::Status halted = rig_.HaltManual();  // a started run goes on
                 if (!halted.ok()) spdlog::error("rig: {}", MessageOf(halted));
               }),
      rig_service_(rig, facts, control_, runs),
      run_service_(runs, facts, control_) {}

absl::StatusOr<std::unique_ptr<Server>> Server::Start(const std::vector<std::string>& addresses,
                                                      Rig& rig, const RigFacts& facts,
                                                      RunManager& runs) {
  // gRPC stays up until the process ends: taking it down waits up to ten seconds for a thread of its own, and meanwhile the devices
  // would stay open and the data directory locked.
  static const bool up = (grpc_init(), true);
  (void)up;
  auto server = std::unique_ptr<Server>(new Server(rig, facts, runs));
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // a second daemon must not share a port
  std::vector<int> ports(addresses.size(), -1);
  for (size_t i = 0; i < addresses.size(); ++i) {
    const std::string& address = addresses[i];
    if (absl::StartsWith(address, "unix:")) {
      std::string path = address.substr(5);
      RETURN_IF_ERROR(ClearSocket(address, path));
      server->sockets_.push_back(path);
    } else {
      RETURN_IF_ERROR(CheckTcp(address));
    }
    builder.AddListeningPort(address, grpc::InsecureServerCredentials(), &ports[i]);
  }
  builder.RegisterService(&server->rig_service_);
  builder.RegisterService(&server->run_service_);
  server->server_ = builder.BuildAndStart();
  for (size_t i = 0; i < addresses.size(); ++i) {
    if (!server->server_ || ports[i] <= 0)
      return AddressInUse(addresses[i], "the address is in use or not this machine's");
    bool tcp = !absl::StartsWith(addresses[i], "unix:");
    server->addresses_.push_back(
        tcp ? absl::StrCat(addresses[i].substr(0, addresses[i].rfind(':')), ":", ports[i])
            : addresses[i]);
  }
  server->health_ = std::thread([s = server.get()] { s->WatchHealth(); });
  return server;
}

Server::~Server() {
  closed_ = true;
  rig_service_.Close();
  run_service_.Close();
  if (health_.joinable()) health_.join();
  if (server_) server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(2));
  for (const std::string& path : sockets_) unlink(path.c_str());
}

void Server::WatchHealth() {
  grpc::HealthCheckServiceInterface* health = server_->GetHealthCheckService();
  for (const char* service : {"lightstage.v1.RigService", "lightstage.v1.RunService"})
    health->SetServingStatus(service, true);
  while (!closed_) {
    health->SetServingStatus("rig", rig_.CheckRunning().ok());
    auto free_bytes = runs_.FreeBytes();
    health->SetServingStatus("store", free_bytes.ok() && *free_bytes >= kReserveBytes);
    absl::SleepFor(absl::Milliseconds(100));
  }
}

}  // namespace lightstage::rpc
