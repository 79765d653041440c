// An Enttec Open DMX USB: an FT232R, a line driver, and a receiver on the line that believes nothing.
//
// Written from Linux' ftdi_sio.h and QEMU's hw/usb/dev-serial.c, and not from the driver: what the driver encodes is decoded here anew.
#pragma once

#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "sim/peers/dmx/fixtures.h"
#include "sim/peers/dmx/usb_device.h"

namespace lightstage::sim {

class OpenDmx final : public SimUsbDevice {
 public:
  OpenDmx(dmx::UsbIdentity identity, Clock& clock, const DmxFixtureOptions& fixtures,
          std::shared_ptr<World> world)
      : SimUsbDevice(std::move(identity), clock),
        slots_(static_cast<size_t>(fixtures.slots)),
        fixtures_(fixtures, std::move(world)) {}

  int whole_frames() const;
  // Why frames were not believed, the last ones; empty if all were whole.
  std::vector<std::string> refusals() const;

 protected:
  bool OnRequest(const dmx::UsbRequest& request, TimePoint now) override
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::optional<std::vector<uint8_t>> OnRequestIn(const dmx::UsbRequest& request,
                                                  TimePoint now) override
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  TimePoint OnBytes(std::span<const uint8_t> bytes, TimePoint now) override
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::vector<uint8_t> OnPoll(TimePoint now) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void OnAdvance(TimePoint now) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void OnPowerLost(TimePoint now) override ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

 private:
  struct OnLine {
    uint8_t byte;
    TimePoint begin, end;
  };

  void Break(bool on, TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Reset() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Hear(const OnLine& heard) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Refuse(std::string why) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::string WrongLine() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const size_t slots_;

  // The chip.
  double baud_ ABSL_GUARDED_BY(mutex_) = 9600;
  int data_bits_ ABSL_GUARDED_BY(mutex_) = 8, parity_ ABSL_GUARDED_BY(mutex_) = 0,
                 stop_bits_ ABSL_GUARDED_BY(mutex_) = 1;
  bool rts_ ABSL_GUARDED_BY(mutex_) = false, hand_shake_ ABSL_GUARDED_BY(mutex_) = false;
  bool break_on_ ABSL_GUARDED_BY(mutex_) = false;
  std::deque<OnLine> buffer_ ABSL_GUARDED_BY(mutex_);  // not yet out, with their places on the line

  // The receiver.
  TimePoint break_begin_ ABSL_GUARDED_BY(mutex_){}, break_end_ ABSL_GUARDED_BY(mutex_){};
  enum class Hearing { kNothing, kStartCode, kSlots, kDone };
  Hearing hearing_ ABSL_GUARDED_BY(mutex_) = Hearing::kNothing;
  std::vector<uint8_t> heard_ ABSL_GUARDED_BY(mutex_);
  DmxFixtures fixtures_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::string> refusals_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace lightstage::sim
