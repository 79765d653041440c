#include "drivers/canopen/can_bus.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "base/own_copy.h"
#include "base/status.h"

namespace lightstage::canopen {
namespace {

// How long the receiving thread sleeps at most: what asks for less is said late by so much.
constexpr Duration kLook = std::chrono::milliseconds(50);

struct Registry {
  Mutex mutex;
  std::map<std::pair<std::string, const Clock*>, std::weak_ptr<CanBus>> buses
      ABSL_GUARDED_BY(mutex);
};

Registry& TheRegistry() {
  static auto* registry = new Registry;
  return *registry;
}

absl::Status Taken(int node, const std::string& bus, const std::string& by) {
  return Error(
      absl::StatusCode::kFailedPrecondition, "NODE_TAKEN",
      absl::StrCat("node ", node, " on ", bus, " is ", by, " already; every device needs its own"),
      {{"node", absl::StrCat(node)}, {"interface", bus}});
}

}  // namespace

std::shared_ptr<CanBus> CanBus::Shared(const std::string& name, Clock& clock, CanPortOpener open) {
  Registry& registry = TheRegistry();
  MutexLock lock(&registry.mutex);
  std::weak_ptr<CanBus>& known = registry.buses[{name, &clock}];
  std::shared_ptr<CanBus> bus = known.lock();
  if (bus == nullptr) {
    bus = std::make_shared<CanBus>(name, clock, std::move(open));
    known = bus;
  }
  return bus;
}

std::shared_ptr<CanBus> CanBus::Find(const std::string& name) {
  Registry& registry = TheRegistry();
  MutexLock lock(&registry.mutex);
  for (const auto& [key, known] : registry.buses) {
    if (key.first != name) continue;
    if (std::shared_ptr<CanBus> bus = known.lock()) return bus;
  }
  return nullptr;
}

CanBus::CanBus(std::string name, Clock& clock, CanPortOpener open)
    : name_(std::move(name)), clock_(clock), open_(std::move(open)) {}

CanBus::~CanBus() {
  quit_ = true;
  MutexLock lock(&connecting_);
  if (thread_.joinable()) thread_.join();
}

absl::Status CanBus::Connect() {
  MutexLock lock(&connecting_);
  {
    MutexLock inner(&mutex_);
    if (port_ != nullptr && !useless_) return OwnCopy(trouble_);
  }
  quit_ = true;
  if (thread_.joinable()) thread_.join();
  quit_ = false;
  {
    MutexLock inner(&mutex_);
    port_.reset();
  }
  absl::StatusOr<std::unique_ptr<CanPort>> opened = open_();
  if (!opened.ok()) {
    // Others may wait for what was to come through the port that was there before.
    Fail(opened.status(), /*useless=*/true);
    return opened.status();
  }
  std::shared_ptr<CanPort> port = *std::move(opened);
  state_ = port->state();
  heard_until_ = clock_.Now().time_since_epoch().count();
  // Before the thread starts, which may find at once that the port is of no use.
  absl::Status connected = state_ == CanState::kBusOff ? BusOff() : absl::OkStatus();
  {
    MutexLock inner(&mutex_);
    port_ = port;
    useless_ = false;
    trouble_ = OwnCopy(connected);
  }
  thread_ = std::thread([this, port] { Run(*port); });
  return connected;
}

absl::Status CanBus::Send(const CanFrame& frame) {
  std::shared_ptr<CanPort> port;
  {
    MutexLock lock(&mutex_);
    if (!trouble_.ok()) return OwnCopy(trouble_);
    port = port_;
  }
  if (port == nullptr) {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                 absl::StrCat(name_, " is not connected"), {{"interface", name_}});
  }
  absl::Status sent = port->Send(frame);
  if (!sent.ok()) {
    // The thread may not have noticed yet.
    MutexLock lock(&mutex_);
    if (port == port_) useless_ = true;
  }
  return sent;
}

absl::Status CanBus::trouble() const {
  MutexLock lock(&mutex_);
  return OwnCopy(trouble_);
}

absl::Status CanBus::Add(int node, const std::string& device, NodeListener* listener) {
  MutexLock lock(&listening_);
  auto [at, added] = listeners_.try_emplace(node, listener, device);
  if (added || at->second.first == listener) return absl::OkStatus();
  return Taken(node, name_, at->second.second + "'s");
}

void CanBus::Remove(int node, NodeListener* listener) {
  MutexLock lock(&listening_);
  auto at = listeners_.find(node);
  if (at != listeners_.end() && at->second.first == listener) listeners_.erase(at);
}

absl::Status CanBus::AddHeartbeat(int id, Duration period, const void* owner) {
  MutexLock lock(&mutex_);
  for (const Heartbeat& other : heartbeats_) {
    const bool both_periodic = other.period > Duration::zero() && period > Duration::zero();
    if (other.id == id && other.owner != owner && !both_periodic) {
      return Taken(id, name_, "this computer's heartbeat for another device");
    }
  }
  std::erase_if(heartbeats_, [&](const Heartbeat& h) { return h.owner == owner; });
  heartbeats_.push_back({owner, id, period});
  return absl::OkStatus();
}

void CanBus::RemoveHeartbeat(const void* owner) {
  MutexLock lock(&mutex_);
  std::erase_if(heartbeats_, [&](const Heartbeat& h) { return h.owner == owner; });
}

// ---- The bus's thread.

void CanBus::Run(CanPort& port) {
  while (!quit_) {
    const TimePoint next = SayDueHeartbeats(port);
    const TimePoint before = clock_.Now();
    const Duration wait = std::clamp<Duration>(next - before, Duration::zero(), kLook);
    absl::StatusOr<std::optional<CanEvent>> event = port.Receive(wait);
    if (!event.ok()) {
      return Fail(event.status(), /*useless=*/true);
    }
    if (!event->has_value()) {
      // It was empty at the latest when the wait was over.
      heard_until_ = (before + wait).time_since_epoch().count();
      continue;
    }
    Dispatch(**event);
    heard_until_ = std::max((*event)->time, heard_until()).time_since_epoch().count();
  }
}

TimePoint CanBus::SayDueHeartbeats(CanPort& port) {
  const TimePoint now = clock_.Now();
  TimePoint next = now + kLook;
  std::vector<int> due;
  {
    MutexLock lock(&mutex_);
    std::map<int, Duration> periods;
    for (const Heartbeat& heartbeat : heartbeats_) {
      if (heartbeat.period <= Duration::zero()) continue;
      Duration& period = periods.try_emplace(heartbeat.id, heartbeat.period).first->second;
      period = std::min(period, heartbeat.period);
    }
    for (const auto& [id, period] : periods) {
      auto [said, first] = said_.try_emplace(id, now);
      if (first || now - said->second >= period) {
        due.push_back(id);
        said->second = now;
      }
      next = std::min(next, said->second + period);
    }
    std::erase_if(said_, [&](const auto& said) { return !periods.contains(said.first); });
    if (!trouble_.ok()) due.clear();
  }
  for (int id : due) {
    if (absl::Status said = port.Send(EncodeHeartbeat(id, NmtState::kOperational)); !said.ok()) {
      spdlog::warn("{}: our heartbeat could not be sent: {}", name_, MessageOf(said));
    }
  }
  return next;
}

void CanBus::Dispatch(const CanEvent& event) {
  if (event.kind == CanEvent::Kind::kError) {
    if (!event.state.has_value()) {
      spdlog::debug("{}: {}", name_, event.error);
      return;
    }
    const CanState before = state_.exchange(*event.state);
    if (before != *event.state) spdlog::warn("{}: {}", name_, event.error);
    if (*event.state == CanState::kBusOff) return Fail(BusOff(), /*useless=*/false);
    // Restarted: those who were told of the trouble connect anew.
    MutexLock lock(&mutex_);
    trouble_ = absl::OkStatus();
    return;
  }
  MutexLock lock(&listening_);
  auto at = listeners_.find(event.frame.id & kNodeMask);
  if (at != listeners_.end()) at->second.first->OnFrame(event.frame, event.time);
}

void CanBus::Fail(const absl::Status& why, bool useless) {
  {
    MutexLock lock(&mutex_);
    trouble_ = OwnCopy(why);
    useless_ = useless_ || useless;
  }
  MutexLock lock(&listening_);
  for (auto& [node, listener] : listeners_) listener.first->OnTrouble(why);
}

absl::Status CanBus::BusOff() const {
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
               absl::StrCat(name_,
                            " is bus-off: its controller gave up after too many errors; check bit "
                            "rate, wiring and termination, then 'ip link set ",
                            name_, " down' and 'up' (or set restart-ms)"),
               {{"interface", name_}, {"state", "bus-off"}});
}

}  // namespace lightstage::canopen
