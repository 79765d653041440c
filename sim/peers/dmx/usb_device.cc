#include "sim/peers/dmx/usb_device.h"

#include <algorithm>
#include <utility>

namespace lightstage::sim {
namespace {

constexpr Duration kMicroframe = std::chrono::microseconds(125);
constexpr Duration kLatency = std::chrono::milliseconds(1);  // between packets that say nothing
constexpr size_t kLong = 100;                                // bytes: more than a question has

absl::Status Lost() { return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST", "unplugged"); }
absl::Status Silent() {
  return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT", "no answer");
}
absl::Status Refused() {
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT", "no such request");
}

}  // namespace

// A handle. Its device lives as long as it does.
class SimUsbPort final : public dmx::UsbPort {
 public:
  SimUsbPort(std::shared_ptr<SimUsbDevice> device, int plug)
      : device_(std::move(device)), plug_(plug) {}
  ~SimUsbPort() override {
    MutexLock lock(&device_->mutex_);
    --device_->handles_;
  }

  const dmx::UsbIdentity& identity() const override { return device_->identity_; }

  absl::Status Control(const dmx::UsbRequest& request, Duration timeout) override {
    RETURN_IF_ERROR(Answers(timeout));
    MutexLock lock(&device_->mutex_);
    const TimePoint now = device_->clock_.Now();
    device_->OnAdvance(now);
    return device_->OnRequest(request, now) ? absl::OkStatus() : Refused();
  }

  absl::StatusOr<size_t> ControlIn(const dmx::UsbRequest& request, std::span<uint8_t> data,
                                   Duration timeout) override {
    RETURN_IF_ERROR(Answers(timeout));
    MutexLock lock(&device_->mutex_);
    const TimePoint now = device_->clock_.Now();
    device_->OnAdvance(now);
    const std::optional<std::vector<uint8_t>> answer = device_->OnRequestIn(request, now);
    if (!answer.has_value()) return Refused();
    return Copy(*answer, data);
  }

  absl::StatusOr<size_t> BulkOut(std::span<const uint8_t> data, Duration timeout) override {
    UsbFault fault = UsbFault::kNone;
    TimePoint ready{};
    size_t taken = data.size();
    const TimePoint deadline = device_->clock_.Now() + timeout;
    {
      MutexLock lock(&device_->mutex_);
      fault = device_->fault_;
      if (fault == UsbFault::kStall) taken = 0;
      const bool half = fault == UsbFault::kShortWrite ||
                        (fault == UsbFault::kUnplugMidFrame && data.size() >= kLong);
      if (half) taken = data.size() / 2;
      if (taken > 0 && device_->plugged_ && device_->plugs_ == plug_ &&
          fault != UsbFault::kSilent) {
        const TimePoint now = device_->clock_.Now();
        device_->OnAdvance(now);
        ready = device_->OnBytes(data.first(taken), now);
      }
    }
    if (fault == UsbFault::kStall) ready = deadline;
    if (!device_->Pass(std::min(ready, deadline), plug_)) return Lost();
    if (fault == UsbFault::kStall || ready > deadline) return Silent();
    if (fault == UsbFault::kUnplugMidFrame && taken < data.size()) {
      device_->Unplug();
      return Lost();
    }
    return taken;
  }

  absl::StatusOr<size_t> BulkIn(std::span<uint8_t> data, Duration timeout) override {
    bool silent = false;
    {
      MutexLock lock(&device_->mutex_);
      silent = device_->fault_ == UsbFault::kSilent;
    }
    const Duration wait = silent ? timeout : std::min(kLatency, timeout);
    if (!device_->Pass(device_->clock_.Now() + wait, plug_)) return Lost();
    if (silent) return 0;
    MutexLock lock(&device_->mutex_);
    const TimePoint now = device_->clock_.Now();
    device_->OnAdvance(now);
    return Copy(device_->OnPoll(now), data);
  }

 private:
  absl::Status Answers(Duration timeout) {
    bool silent = false;
    {
      MutexLock lock(&device_->mutex_);
      silent = device_->fault_ == UsbFault::kSilent;
    }
    const Duration wait = silent ? timeout : kMicroframe;
    if (!device_->Pass(device_->clock_.Now() + wait, plug_)) return Lost();
    return silent ? Silent() : absl::OkStatus();
  }

  static size_t Copy(const std::vector<uint8_t>& from, std::span<uint8_t> to) {
    const size_t count = std::min(from.size(), to.size());
    std::copy_n(from.begin(), count, to.begin());
    return count;
  }

  const std::shared_ptr<SimUsbDevice> device_;
  const int plug_;
};

void SimUsbDevice::Plug() {
  MutexLock lock(&mutex_);
  if (plugged_) return;
  plugged_ = true;
  ++plugs_;
}

void SimUsbDevice::Unplug() {
  {
    MutexLock lock(&mutex_);
    if (plugged_) UnplugLocked(clock_.Now());
  }
  clock_.Notify();
}

void SimUsbDevice::UnplugLocked(TimePoint now) {
  OnAdvance(now);
  OnPowerLost(now);
  plugged_ = false;
}

void SimUsbDevice::Fail(UsbFault fault) {
  MutexLock lock(&mutex_);
  fault_ = fault;
}

bool SimUsbDevice::plugged() const {
  MutexLock lock(&mutex_);
  return plugged_;
}

int SimUsbDevice::handles() const {
  MutexLock lock(&mutex_);
  return handles_;
}

int SimUsbDevice::opened() const {
  MutexLock lock(&mutex_);
  return opened_;
}

void SimUsbDevice::Advance() {
  MutexLock lock(&mutex_);
  if (plugged_) OnAdvance(clock_.Now());
}

void SimUsbDevice::WakeAt(TimePoint time) {
  clock_.At(time, [self = weak_from_this()] {
    if (std::shared_ptr<SimUsbDevice> device = self.lock()) device->Advance();
  });
}

absl::StatusOr<std::unique_ptr<dmx::UsbPort>> SimUsbDevice::Open() {
  MutexLock lock(&mutex_);
  if (!plugged_) return sim::Lost();
  if (handles_ > 0) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_BUSY", "it is open already");
  }
  ++handles_;
  ++opened_;
  return std::make_unique<SimUsbPort>(shared_from_this(), plugs_);
}

bool SimUsbDevice::Lost(int plug) const {
  MutexLock lock(&mutex_);
  return !plugged_ || plugs_ != plug;
}

bool SimUsbDevice::Pass(TimePoint until, int plug) {
  return !clock_.WaitUntil(until, [&] { return Lost(plug); });
}

namespace {

class SimUsbBus final : public dmx::UsbBus {
 public:
  explicit SimUsbBus(std::vector<std::shared_ptr<SimUsbDevice>> devices)
      : devices_(std::move(devices)) {}

  absl::StatusOr<std::vector<dmx::UsbIdentity>> List() override {
    std::vector<dmx::UsbIdentity> identities;
    for (const auto& device : Plugged()) identities.push_back(device->identity());
    return identities;
  }

  absl::StatusOr<std::unique_ptr<dmx::UsbPort>> Open(const dmx::UsbSelector& selector) override {
    const std::vector<std::shared_ptr<SimUsbDevice>> plugged = Plugged();
    std::vector<dmx::UsbIdentity> identities;
    for (const auto& device : plugged) identities.push_back(device->identity());
    ASSIGN_OR_RETURN(const size_t which, dmx::SelectDevice(identities, selector));
    return plugged[which]->Open();
  }

 private:
  std::vector<std::shared_ptr<SimUsbDevice>> Plugged() const {
    std::vector<std::shared_ptr<SimUsbDevice>> plugged;
    for (const auto& device : devices_) {
      if (device->plugged()) plugged.push_back(device);
    }
    return plugged;
  }

  const std::vector<std::shared_ptr<SimUsbDevice>> devices_;
};

}  // namespace

std::unique_ptr<dmx::UsbBus> MakeSimUsbBus(std::vector<std::shared_ptr<SimUsbDevice>> devices) {
  return std::make_unique<SimUsbBus>(std::move(devices));
}

}  // namespace lightstage::sim
