#include "sim/peers/uvc/camera_server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/status.h"

namespace lightstage::sim {
namespace {

// A payload's header: its length and bmHeaderInfo.
constexpr size_t kHeaderBytes = 2;
constexpr uint8_t kFrameId = 1 << 0, kEndOfFrame = 1 << 1, kErrorBit = 1 << 6,
                  kEndOfHeader = 1 << 7;

}  // namespace

UvcCameraServer::UvcCameraServer(const UvcCameraOptions& options, std::shared_ptr<World> world,
                                 int socket)
    : options_(options),
      world_(std::move(world)),
      camera_(options,
              [this] {
                world_->clock().Notify();
                if (UsbipConnection* connection = waker_) connection->Wake();
              }),
      connection_(socket, camera_, kStreamEndpoint) {
  waker_ = &connection_;
  thread_ = std::thread([this] { Run(); });
}

UvcCameraServer::~UvcCameraServer() {
  quit_ = true;
  world_->clock().Notify();
  connection_.Wake();
  thread_.join();
}

void UvcCameraServer::Fail(UvcFault fault) {
  fault_ = fault;
  camera_.Stall(fault == UvcFault::kStalls);
}

void UvcCameraServer::BreakTransfers() {
  ++broken_;
  connection_.FailRequests(EPROTO);
}

void UvcCameraServer::Run() {
  while (!quit_) {
    // Without a stream nobody asks for bytes.
    if (!connection_.AwaitRequests(1, [this] { return quit_.load(); })) return;
    if (const uint64_t stream = camera_.stream(); stream != 0) {
      RunStream(stream);
    } else {
      world_->clock().WaitUntil(kNever, [this] { return quit_ || camera_.stream() != 0; });
    }
  }
}

void UvcCameraServer::RunStream(uint64_t stream) {
  Clock& clock = world_->clock();
  const auto over = [this, stream] { return Over(stream); };
  bool odd = false;  // alternates from one frame that is sent to the next
  int skipped = 0;
  while (connection_.AwaitRequests(1, over)) {
    const UvcCamera::Shot shot = camera_.Begin(clock);
    const TimePoint end =
        shot.start + shot.exposure + world_->RowLag(options_.height) + options_.latency;
    if (clock.WaitUntil(end, over)) return;
    const UvcFault fault = fault_;
    skipped = fault == UvcFault::kSkips ? (skipped + 1) % 4 : 0;
    if (fault != UvcFault::kSilent && skipped == 0) {
      if (!SendFrame(shot, std::exchange(odd, !odd), stream)) return;
    }
    if (clock.WaitUntil(shot.start + options_.frame_interval, over)) return;
  }
}

std::vector<uint8_t> UvcCameraServer::Expose(const UvcCamera::Shot& shot) {
  absl::StatusOr<Frame> frame =
      world_->Expose(shot.start, shot.start + shot.exposure, shot.format,
                     {options_.width, options_.height}, options_.bits, shot.gain_db);
  ++frames_;
  if (!frame.ok()) {
    spdlog::error("simulated USB camera: {}", MessageOf(frame.status()));
    return {};
  }
  std::vector<uint8_t> bytes(frame->data.size());
  std::memcpy(bytes.data(), frame->data.data(), bytes.size());
  return bytes;
}

// The host asks anew with each request that it has taken in; with those that failed it need not.
void UvcCameraServer::AwaitTaken(size_t asked, int broken, uint64_t stream) {
  connection_.AwaitRequests(asked,
                            [this, stream, broken] { return Over(stream) || broken_ != broken; });
}

bool UvcCameraServer::SendFrame(const UvcCamera::Shot& shot, bool odd, uint64_t stream) {
  const auto send = [&](std::span<const uint8_t> part, uint8_t info) {
    std::vector<uint8_t> payload = {kHeaderBytes, static_cast<uint8_t>(kEndOfHeader | info)};
    if (odd) payload[1] |= kFrameId;
    payload.insert(payload.end(), part.begin(), part.end());
    return connection_.Send(payload, kUvcPayloadBytes, [this, stream] { return Over(stream); });
  };
  const size_t asked = connection_.requests();
  const int broken = broken_;
  if (!send({}, 0)) return false;
  AwaitTaken(asked, broken, stream);
  // By now it is stamped.
  const bool late = options_.latency_limit &&
                    world_->clock().Now() > shot.start + shot.exposure + *options_.latency_limit;
  std::vector<uint8_t> bytes = Expose(shot);
  const UvcFault fault = fault_;
  const bool wrong = fault == UvcFault::kDamaged || bytes.empty();
  if (wrong) {
    for (size_t i = bytes.size() / 2; i < bytes.size(); ++i) bytes[i] ^= 0xff;
  }
  if (fault == UvcFault::kShort) bytes.resize(bytes.size() / 2);
  std::span<const uint8_t> rest = bytes;
  do {
    const std::span<const uint8_t> part =
        rest.first(std::min(rest.size(), kUvcPayloadBytes - kHeaderBytes));
    rest = rest.subspan(part.size());
    if (!send(part, (rest.empty() ? kEndOfFrame : 0) | (wrong || late ? kErrorBit : 0)))
      return false;
  } while (!rest.empty());
  AwaitTaken(asked, broken, stream);
  return true;
}

}  // namespace lightstage::sim
