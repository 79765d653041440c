#include "drivers/canopen/memory_bus.h"

#include <algorithm>
#include <deque>

#include "base/status.h"

namespace lightstage::canopen {
namespace {

constexpr size_t kRemembered = 4096;
// Like a socket's buffer: a receiver that never looks loses what comes.
constexpr size_t kQueued = 4096;

absl::Status Gone() {
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "the CAN interface is gone");
}

}  // namespace

struct MemoryBus::Wire {
  explicit Wire(Clock& c) : clock(c) {}
  Clock& clock;
  mutable Mutex mutex;
  CondVar changed;
  std::vector<Port*> ports ABSL_GUARDED_BY(mutex);
  std::deque<CanFrame> sent ABSL_GUARDED_BY(mutex);
  CanState state ABSL_GUARDED_BY(mutex) = CanState::kActive;
  bool present ABSL_GUARDED_BY(mutex) = true;
};

class MemoryBus::Port final : public CanPort {
 public:
  explicit Port(std::shared_ptr<Wire> wire) : wire_(std::move(wire)) {
    MutexLock lock(&wire_->mutex);
    wire_->ports.push_back(this);
    state_ = at_opening_ = wire_->state;
    gone_ = !wire_->present;
  }
  ~Port() override {
    MutexLock lock(&wire_->mutex);
    std::erase(wire_->ports, this);
  }

  absl::Status Send(const CanFrame& frame) override {
    MutexLock lock(&wire_->mutex);
    if (gone_) return Gone();
    // The kernel takes frames of a bus-off controller and drops them; only the event tells.
    if (state_ == CanState::kBusOff) return absl::OkStatus();
    wire_->sent.push_back(frame);
    if (wire_->sent.size() > kRemembered) wire_->sent.pop_front();
    const TimePoint now = wire_->clock.Now();
    for (Port* port : wire_->ports) {
      port->wire_->mutex.AssertHeld();
      if (port == this || port->state_ == CanState::kBusOff) continue;
      if (port->queue_.size() < kQueued) {
        port->queue_.push_back({.kind = CanEvent::Kind::kFrame, .time = now, .frame = frame});
      }
    }
    wire_->changed.SignalAll();
    return absl::OkStatus();
  }

  absl::StatusOr<std::optional<CanEvent>> Receive(Duration timeout) override {
    const TimePoint deadline = wire_->clock.Now() + timeout;
    MutexLock lock(&wire_->mutex);
    while (queue_.empty() && !gone_) {
      const Duration left = deadline - wire_->clock.Now();
      if (left <= Duration::zero()) return std::optional<CanEvent>();
      wire_->changed.WaitFor(&wire_->mutex, left);
    }
    if (gone_) return Gone();
    std::optional<CanEvent> event = std::move(queue_.front());
    queue_.pop_front();
    return event;
  }

  CanState state() const override { return at_opening_; }

  // With the wire's lock, which the analysis does not know for this port's.
  void ChangeTo(CanState state) {
    wire_->mutex.AssertHeld();
    if (state_ == state) return;
    state_ = state;
    queue_.push_back({.kind = CanEvent::Kind::kError,
                      .time = wire_->clock.Now(),
                      .frame = {},
                      .state = state,
                      .error = std::string(CanStateName(state))});
  }
  void Remove() {
    wire_->mutex.AssertHeld();
    gone_ = true;
  }

 private:
  const std::shared_ptr<Wire> wire_;  // shared: with the bus, which may go first
  CanState at_opening_ = CanState::kActive;
  std::deque<CanEvent> queue_ ABSL_GUARDED_BY(wire_->mutex);
  CanState state_ ABSL_GUARDED_BY(wire_->mutex) = CanState::kActive;
  bool gone_ ABSL_GUARDED_BY(wire_->mutex) = false;
};

MemoryBus::MemoryBus(Clock& clock) : wire_(std::make_shared<Wire>(clock)) {}
MemoryBus::~MemoryBus() = default;

std::unique_ptr<CanPort> MemoryBus::Attach() { return std::make_unique<Port>(wire_); }

void MemoryBus::SetState(CanPort& port, CanState state) {
  MutexLock lock(&wire_->mutex);
  for (Port* attached : wire_->ports) {
    if (attached == &port) attached->ChangeTo(state);
  }
  wire_->changed.SignalAll();
}

void MemoryBus::SetState(CanState state) {
  MutexLock lock(&wire_->mutex);
  wire_->state = state;
  for (Port* attached : wire_->ports) attached->ChangeTo(state);
  wire_->changed.SignalAll();
}

void MemoryBus::SetPresent(bool present) {
  MutexLock lock(&wire_->mutex);
  wire_->present = present;
  if (!present) {
    for (Port* attached : wire_->ports) attached->Remove();
  }
  wire_->changed.SignalAll();
}

std::vector<CanFrame> MemoryBus::Sent() const {
  MutexLock lock(&wire_->mutex);
  return {wire_->sent.begin(), wire_->sent.end()};
}

}  // namespace lightstage::canopen
