#include "client/cpp/connection.h"

#include <sys/un.h>

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include "base/strings.h"
#include "grpc/grpc.h"
#include "grpc/support/time.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "grpcpp/support/channel_arguments.h"

namespace lightstage::client {
namespace {

// A name server or a far host may take this long before it refuses.
constexpr Duration kConnectDeadline = std::chrono::seconds(5);
// How often a wait for the channel looks whether it was cancelled.
constexpr Duration kPoll = std::chrono::milliseconds(50);

gpr_timespec After(Duration d) {
  return gpr_time_from_nanos(std::max<int64_t>(d.count(), 0), GPR_TIMESPAN);
}

absl::Status AddressError(const std::string& address, std::string_view what) {
  return Error(
      absl::StatusCode::kInvalidArgument, "ADDRESS_INVALID",
      absl::StrCat("address '", address, "' ", what, ": give unix:PATH, HOST:PORT or [IPV6]:PORT"),
      {{"address", address}});
}

// The address as a gRPC target.
absl::StatusOr<std::string> Target(const std::string& address) {
  absl::string_view rest = address;
  if (absl::ConsumePrefix(&rest, "unix:")) {
    if (rest.empty()) return AddressError(address, "has no path");
    if (rest.size() >= sizeof(sockaddr_un::sun_path)) {
      return AddressError(address, "has a longer path than a socket can have");
    }
    // gRPC reads the path as part of a URI.
    return absl::StrCat("unix:",
                        absl::StrReplaceAll(rest, {{"%", "%25"}, {"?", "%3F"}, {"#", "%23"}}));
  }
  size_t colon = rest.rfind(':');
  if (colon == absl::string_view::npos) return AddressError(address, "has no port");
  absl::string_view host = rest.substr(0, colon);
  int port = 0;
  if (!absl::SimpleAtoi(rest.substr(colon + 1), &port) || port < 1 || port > 65535) {
    return AddressError(address, "has a port outside of 1 to 65535");
  }
  bool bracketed = absl::StartsWith(host, "[") && absl::EndsWith(host, "]");
  if (host.empty() || absl::StrContains(host, "/") ||
      (absl::StrContains(host, ":") && !bracketed)) {
    return AddressError(address, "has an unreadable host");
  }
  return absl::StrCat("dns:///", address);
}

}  // namespace

std::string DefaultAddress() {
  const char* address = std::getenv("LIGHTSTAGE_ADDRESS");
  return address != nullptr && *address != '\0' ? address : "127.0.0.1:7420";
}

Connection::Connection(std::string address, std::shared_ptr<grpc::Channel> channel, Clock& clock)
    : address_(std::move(address)),
      clock_(clock),
      channel_(std::move(channel)),
      rig_(v1::RigService::NewStub(channel_)),
      runs_(v1::RunService::NewStub(channel_)) {}

absl::Status Connection::WaitReady(TimePoint deadline, bool patient, Canceller& canceller) {
  for (;;) {
    grpc_connectivity_state state = channel_->GetState(/*try_to_connect=*/true);
    if (state == GRPC_CHANNEL_READY) return absl::OkStatus();
    if (canceller.cancelled()) {
      return Error(absl::StatusCode::kCancelled, kCancelled, "cancelled while connecting");
    }
    TimePoint now = clock_.Now();
    if (now >= deadline || (state == GRPC_CHANNEL_TRANSIENT_FAILURE && !patient)) {
      return Error(absl::StatusCode::kUnavailable, kCannotConnect,
                   absl::StrCat("cannot connect to ", address_,
                                ": is lightstaged running and listening there?"),
                   {{"address", address_}});
    }
    channel_->WaitForStateChange(state, After(std::min(kPoll, deadline - now)));
  }
}

absl::StatusOr<std::unique_ptr<Connection>> Connect(const std::string& address, Clock& clock,
                                                    Canceller& canceller, Duration wait) {
  ASSIGN_OR_RETURN(std::string target, Target(address));
  grpc::ChannelArguments arguments;
  // A rig is in the same room: a proxy set for the web must not be asked.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  // A stream may be silent for hours while a run is paused: pings tell that the daemon is still
  // there.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 30000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Each connection its own socket, so that one client's trouble is not another's.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetMaxReceiveMessageSize(64 << 20);
  auto connection = std::make_unique<Connection>(
      address, grpc::CreateCustomChannel(target, grpc::InsecureChannelCredentials(), arguments),
      clock);
  RETURN_IF_ERROR(
      connection->WaitReady(clock.Now() + (wait > Duration::zero() ? wait : kConnectDeadline),
                            wait > Duration::zero(), canceller));
  return connection;
}

void SetDeadline(grpc::ClientContext& context, Duration deadline) {
  context.set_deadline(After(deadline));
}

absl::Status CallStatus(const grpc::Status& status, const Canceller& canceller) {
  if (!status.ok() && canceller.cancelled()) {
    return Error(absl::StatusCode::kCancelled, kCancelled, "cancelled");
  }
  return FromGrpc(status);
}

}  // namespace lightstage::client
