// A USB within this process: devices that can be plugged in, unplugged and made to fail, behind the driver's UsbBus.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "drivers/dmx/usb_port.h"

namespace lightstage::sim {

enum class UsbFault {
  kNone,
  kStall,           // takes no byte
  kShortWrite,      // takes half of what it is sent, without a word
  kSilent,          // takes bytes and does nothing; answers no request
  kUnplugMidFrame,  // is unplugged when half of the next long transfer is through
  kNeverEmpty,      // says that it still has bytes to send
};

// Thread-safe. On real time: transfers take as long as they would.
class SimUsbDevice : public std::enable_shared_from_this<SimUsbDevice> {
 public:
  SimUsbDevice(dmx::UsbIdentity identity, Clock& clock)
      : identity_(std::move(identity)), clock_(clock) {}
  virtual ~SimUsbDevice() = default;

  const dmx::UsbIdentity& identity() const { return identity_; }

  void Plug();
  void Unplug();
  void Fail(UsbFault fault);  // until told otherwise
  bool plugged() const;
  int handles() const;  // open ones
  int opened() const;   // ever
  // Lets what is due happen. Light is right without it: a timer calls it too.
  void Advance();

  // FAILED_PRECONDITION / DEVICE_BUSY if it is open. Unlike others, this port is for any number of threads.
  absl::StatusOr<std::unique_ptr<dmx::UsbPort>> Open();

 protected:
  // What the device does. `now` does not decrease.
  virtual bool OnRequest(const dmx::UsbRequest& request, TimePoint now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;  // false: it has no such request
  virtual std::optional<std::vector<uint8_t>> OnRequestIn(const dmx::UsbRequest& request,
                                                          TimePoint now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;
  // Returns when it has room for them.
  virtual TimePoint OnBytes(std::span<const uint8_t> bytes, TimePoint now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;
  // One packet for the host.
  virtual std::vector<uint8_t> OnPoll(TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;
  virtual void OnAdvance(TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;
  virtual void OnPowerLost(TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;

  // Has Advance() called then.
  void WakeAt(TimePoint time);

  mutable Mutex mutex_;
  UsbFault fault_ ABSL_GUARDED_BY(mutex_) = UsbFault::kNone;

 private:
  friend class SimUsbPort;

  bool Lost(int plug) const;
  // Waits; false if it was unplugged meanwhile.
  bool Pass(TimePoint until, int plug);
  void UnplugLocked(TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const dmx::UsbIdentity identity_;
  Clock& clock_;
  bool plugged_ ABSL_GUARDED_BY(mutex_) = true;
  int plugs_ ABSL_GUARDED_BY(mutex_) = 0;  // counts: a handle is for one
  int handles_ ABSL_GUARDED_BY(mutex_) = 0, opened_ ABSL_GUARDED_BY(mutex_) = 0;
};

// The bus as the driver gets it: the devices are shared with the test that plugs them.
std::unique_ptr<dmx::UsbBus> MakeSimUsbBus(std::vector<std::shared_ptr<SimUsbDevice>> devices);

}  // namespace lightstage::sim
