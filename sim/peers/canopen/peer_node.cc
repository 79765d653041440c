#include "sim/peers/canopen/peer_node.h"

#include <algorithm>
#include <utility>

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr Duration kTick = milliseconds(2);
constexpr uint8_t kOperational = 5, kStopped = 4, kPreOperational = 127;
constexpr int kMappable = 4;

}  // namespace

PeerNode::PeerNode(std::unique_ptr<canopen::CanPort> port, const PeerIdentity& identity,
                   PeerProfile& profile, Clock& clock)
    : port_(std::move(port)), identity_(identity), profile_(profile), clock_(clock) {}

PeerNode::~PeerNode() {
  quit_ = true;
  if (thread_.joinable()) thread_.join();
}

void PeerNode::Start() {
  {
    MutexLock lock(&mutex_);
    Boot();
  }
  thread_ = std::thread([this] { Run(); });
}

void PeerNode::Do(absl::FunctionRef<void(ObjectDictionary&)> change) {
  MutexLock lock(&mutex_);
  change(objects_);
}

bool PeerNode::operational() const {
  MutexLock lock(&mutex_);
  return state_ == kOperational;
}

uint32_t PeerNode::Value(uint16_t index, uint8_t sub) const {
  MutexLock lock(&mutex_);
  return objects_.Value(index, sub);
}

std::string PeerNode::TextOf(uint16_t index, uint8_t sub) const {
  MutexLock lock(&mutex_);
  return objects_.TextOf(index, sub);
}

void PeerNode::SetSilent(bool silent) { silent_ = silent; }
void PeerNode::DelayAnswers(Duration delay) { delay_ns_ = delay.count(); }

void PeerNode::Reboot() {
  MutexLock lock(&mutex_);
  Boot();
}

void PeerNode::Emergency(uint16_t code, uint8_t error_register) {
  Say(static_cast<uint16_t>(128 + identity_.node),
      {static_cast<uint8_t>(code % 256), static_cast<uint8_t>(code / 256), error_register, 0, 0, 0,
       0, 0});
}

void PeerNode::Say(uint16_t id, std::vector<uint8_t> bytes) {
  if (silent_) return;
  canopen::CanFrame frame;
  frame.id = id;
  frame.size = static_cast<uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  (void)port_->Send(frame);  // a wire that is cut is the tests' doing
}

void PeerNode::DeclareCommunication() {
  objects_.Constant(0x1000, 0, 4, identity_.device_type);
  objects_.Constant(0x1001, 0, 1, 0);
  if (!identity_.name.empty()) objects_.Text(0x1008, 0, identity_.name);
  objects_.Text(0x100A, 0, "1.0", /*writable=*/true);
  objects_.Constant(0x1016, 0, 1, 1);
  objects_.Variable(0x1016, 1, 4, 0, [this](uint32_t) -> uint32_t {
    mutex_.AssertHeld();
    master_heard_.reset();  // it is watched from its next heartbeat on
    master_lost_ = false;
    return 0;
  });
  objects_.Variable(0x1017, 0, 2, 0, [this](uint32_t) -> uint32_t {
    mutex_.AssertHeld();
    said_ = {};
    return 0;
  });
  objects_.Constant(0x1018, 0, 1, 4);
  objects_.Constant(0x1018, 1, 4, identity_.vendor);
  objects_.Constant(0x1018, 2, 4, identity_.product);
  objects_.Constant(0x1018, 3, 4, identity_.revision);
  objects_.Constant(0x1018, 4, 4, identity_.serial);
  objects_.Constant(0x1029, 0, 1, 1);
  objects_.Variable(0x1029, 1, 1, 1);  // stays operational unless told otherwise
  objects_.Constant(0x1800, 0, 1, 5);
  objects_.Variable(0x1800, 1, 4, 0xC0000180u + static_cast<uint32_t>(identity_.node));
  objects_.Variable(0x1800, 2, 1, 254);
  objects_.Variable(0x1800, 3, 2, 0);
  objects_.Variable(0x1800, 5, 2, 0);
  auto unless_valid = [this](uint32_t) -> uint32_t {
    mutex_.AssertHeld();
    return (objects_.Value(0x1800, 1) & 0x80000000u) != 0 ? 0 : 0x06010000;
  };
  objects_.Variable(0x1A00, 0, 1, 0, unless_valid);
  for (int i = 1; i <= kMappable; ++i) {
    objects_.Variable(0x1A00, static_cast<uint8_t>(i), 4, 0,
                      [this, unless_valid](uint32_t entry) -> uint32_t {
                        mutex_.AssertHeld();
                        if (objects_.Value(0x1A00, 0) != 0) return 0x06010000;
                        const bool there = objects_.Has(static_cast<uint16_t>(entry >> 16),
                                                        static_cast<uint8_t>(entry >> 8 & 0xFF));
                        return there ? unless_valid(entry) : 0x06040041;
                      });
  }
}

void PeerNode::Boot() {
  objects_.Clear();
  server_.Reset();
  DeclareCommunication();
  profile_.Declare(objects_);
  master_heard_.reset();
  master_lost_ = false;
  pdo_.clear();
  state_ = 0;
  Say(static_cast<uint16_t>(1792 + identity_.node), {0});
  SetState(kPreOperational);
}

void PeerNode::SetState(uint8_t state) {
  const bool was = state_ == kOperational;
  state_ = state;
  if (was != (state == kOperational)) profile_.NmtChanged(state == kOperational);
}

void PeerNode::Run() {
  TimePoint tick = clock_.Now();
  while (!quit_) {
    const Duration wait = std::max<Duration>(tick - clock_.Now(), Duration::zero());
    absl::StatusOr<std::optional<canopen::CanEvent>> event = port_->Receive(wait);
    if (!event.ok()) {
      SleepFor(clock_, kTick);  // the wire is cut: it lives on alone
    }
    const TimePoint now = clock_.Now();
    MutexLock lock(&mutex_);
    if (event.ok() && event->has_value() && (*event)->kind == canopen::CanEvent::Kind::kFrame &&
        !silent_) {
      Hear((*event)->frame, now);
    }
    if (now < tick) continue;
    tick = now + kTick;
    profile_.Tick(now);
    SayWhatIsDue(now);
  }
}

void PeerNode::Hear(const canopen::CanFrame& frame, TimePoint now) {
  const auto node = static_cast<uint32_t>(identity_.node);
  const uint32_t watched = objects_.Value(0x1016, 1) >> 16 & 0x7F;
  if (frame.id == 0 && frame.size == 2 && (frame.data[1] == 0 || frame.data[1] == node)) {
    switch (frame.data[0]) {
      case 1:
        return SetState(kOperational);
      case 2:
        return SetState(kStopped);
      case 128:
        return SetState(kPreOperational);
      case 129:
      case 130:
        return Boot();
      default:
        return;
    }
  }
  if (frame.id == 0x600 + node && state_ != kStopped) {
    std::optional<std::vector<uint8_t>> answer = server_.Handle({frame.data.data(), frame.size});
    if (!answer.has_value()) return;
    if (delay_ns_ > 0) SleepFor(clock_, Duration(delay_ns_.load()));
    Say(static_cast<uint16_t>(0x580 + node), *std::move(answer));
  } else if (watched != 0 && frame.id == 0x700 + watched) {
    master_heard_ = now;
    if (std::exchange(master_lost_, false)) Emergency(0, 0);
  }
}

void PeerNode::SayWhatIsDue(TimePoint now) {
  const Duration watch = milliseconds(objects_.Value(0x1016, 1) & 0xFFFF);
  if (watch > Duration::zero() && master_heard_.has_value() && !master_lost_ &&
      now - *master_heard_ > watch) {
    master_lost_ = true;
    Emergency(0x8130, 0x11);
    profile_.MasterLost();
    const uint32_t behaviour = objects_.Value(0x1029, 1);
    if (state_ == kOperational && behaviour == 0) SetState(kPreOperational);
    if (behaviour == 2) SetState(kStopped);
  }
  const Duration period = milliseconds(objects_.Value(0x1017, 0));
  if (period > Duration::zero() && now - said_ >= period) {
    said_ = now;
    Say(static_cast<uint16_t>(0x700 + identity_.node), {state_});
  }
  SayPdo(now);
}

void PeerNode::SayPdo(TimePoint now) {
  const uint32_t id = objects_.Value(0x1800, 1);
  if (state_ != kOperational || (id & 0x80000000u) != 0 || objects_.Value(0x1800, 2) < 254) return;
  std::vector<uint8_t> bytes;
  for (uint32_t i = 1; i <= objects_.Value(0x1A00, 0); ++i) {
    const uint32_t entry = objects_.Value(0x1A00, static_cast<uint8_t>(i));
    uint32_t value =
        objects_.Value(static_cast<uint16_t>(entry >> 16), static_cast<uint8_t>(entry >> 8 & 0xFF));
    // Whole bytes only: this node has nothing else to map.
    for (uint32_t bit = 0; bit < (entry & 0xFF); bit += 8, value >>= 8) {
      bytes.push_back(static_cast<uint8_t>(value & 0xFF));
    }
  }
  if (bytes.empty() || bytes.size() > 8) return;
  const Duration timer = milliseconds(objects_.Value(0x1800, 5));
  if (bytes == pdo_ && (timer == Duration::zero() || now - pdo_said_ < timer)) return;
  pdo_ = bytes;
  pdo_said_ = now;
  Say(static_cast<uint16_t>(id & 0x7FF), std::move(bytes));
}

}  // namespace lightstage::sim
