// A client's connection to one daemon, and how calls are made over it.
//
//   ASSIGN_OR_RETURN(auto connection, Connect(DefaultAddress(), clock, canceller));
//   ASSIGN_OR_RETURN(v1::GetRigResponse rig, Call(connection->rig(), &v1::RigService::Stub::GetRig, {}, canceller));
#pragma once

#include <memory>
#include <string>
#include <type_traits>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/status.h"
#include "client/cpp/canceller.h"
#include "client/cpp/error.h"
#include "grpcpp/channel.h"
#include "grpcpp/client_context.h"
#include "grpcpp/support/sync_stream.h"
#include "lightstage/v1/rig.grpc.pb.h"
#include "lightstage/v1/run.grpc.pb.h"

namespace lightstage::client {

// $LIGHTSTAGE_ADDRESS, or "127.0.0.1:7420" if that is unset or empty.
std::string DefaultAddress();

// Thread-safe. Calls made after the daemon was gone reconnect by themselves.
class Connection {
 public:
  Connection(std::string address, std::shared_ptr<grpc::Channel> channel, Clock& clock);

  // As it was given to Connect().
  const std::string& address() const { return address_; }
  Clock& clock() const { return clock_; }
  v1::RigService::Stub& rig() { return *rig_; }
  v1::RunService::Stub& runs() { return *runs_; }

  // Waits until the daemon is reached: UNAVAILABLE / CANNOT_CONNECT, at once when it refuses unless
  // `patient`, or at `deadline`.
  absl::Status WaitReady(TimePoint deadline, bool patient, Canceller& canceller);

 private:
  const std::string address_;
  Clock& clock_;
  std::shared_ptr<grpc::Channel> channel_;  // shared: gRPC hands it out so
  std::unique_ptr<v1::RigService::Stub> rig_;
  std::unique_ptr<v1::RunService::Stub> runs_;
};

// `address` is "unix:PATH", "HOST:PORT" or "[IPV6]:PORT" (INVALID_ARGUMENT / ADDRESS_INVALID).
// Tries again for `wait` when nobody answers (a daemon that is starting); with `wait` 0 a refusal
// is final. `clock` must be on real time and outlive the connection.
absl::StatusOr<std::unique_ptr<Connection>> Connect(const std::string& address, Clock& clock,
                                                    Canceller& canceller, Duration wait = {});

// Deadline of calls that touch no device.
constexpr Duration kCallDeadline = std::chrono::seconds(20);
// Deadline of calls that wait for motion. Short of it, the lease tells when the daemon is gone.
constexpr Duration kMotionDeadline = std::chrono::hours(1);

// Gives a call its deadline, from now on the monotonic clock.
void SetDeadline(grpc::ClientContext& context, Duration deadline);

// The error of a call: CANCELLED / CLIENT_CANCELLED if `canceller` ended it.
absl::Status CallStatus(const grpc::Status& status, const Canceller& canceller);

// One unary call.
template <class Stub, class Request, class Response>
absl::StatusOr<Response> Call(Stub& stub,
                              grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                           Response*),
                              const std::type_identity_t<Request>& request, Canceller& canceller,
                              Duration deadline = kCallDeadline) {
  grpc::ClientContext context;
  SetDeadline(context, deadline);
  Canceller::CallScope scope(canceller, context);
  Response response;
  grpc::Status status = (stub.*method)(&context, request, &response);
  RETURN_IF_ERROR(CallStatus(status, canceller));
  return response;
}

// One call that is answered by a stream. `on_message` returns false to end the call: that is no
// error. There is no deadline, as a watch may last for days; a peer that is gone is noticed by the
// transport's pings within a minute (CONNECTION_LOST).
template <class Stub, class Request, class Response>
absl::Status ReadStream(Stub& stub,
                        std::unique_ptr<grpc::ClientReader<Response>> (Stub::*method)(
                            grpc::ClientContext*, const Request&),
                        const std::type_identity_t<Request>& request, Canceller& canceller,
                        absl::FunctionRef<bool(const std::type_identity_t<Response>&)> on_message) {
  grpc::ClientContext context;
  Canceller::CallScope scope(canceller, context);
  auto reader = (stub.*method)(&context, request);
  Response message;
  bool enough = false;
  while (!enough && reader->Read(&message)) enough = !on_message(message);
  if (enough) context.TryCancel();
  grpc::Status status = reader->Finish();
  return enough ? absl::OkStatus() : CallStatus(status, canceller);
}

}  // namespace lightstage::client
