// An Enttec DMX USB Pro: an FTDI chip, a microcontroller that takes messages and sends packets by itself.
//
// Written from Enttec's "DMX USB Pro Widget API Specification 1.44", and not from the driver.
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "sim/peers/dmx/fixtures.h"
#include "sim/peers/dmx/usb_device.h"

namespace lightstage::sim {

struct DmxProOptions {
  uint32_t serial_bcd = 0x00396804;  // as printed: 00396804
  int packets_per_second = 40;       // 0: as many as possible
  bool chatty = false;               // sends messages that nobody asked for, too
};

class DmxPro final : public SimUsbDevice {
 public:
  DmxPro(dmx::UsbIdentity identity, Clock& clock, const DmxProOptions& options,
         const DmxFixtureOptions& fixtures, std::shared_ptr<World> world)
      : SimUsbDevice(std::move(identity), clock),
        options_(options),
        fixtures_(fixtures, std::move(world)) {}

  // Packets go out again and again.
  bool sending() const;
  void SetSerial(uint32_t bcd);

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
  struct Packet {
    std::vector<uint8_t> slots;
    TimePoint begin, end;
  };

  void Take(uint8_t byte, TimePoint now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Obey(uint8_t label, const std::vector<uint8_t>& data, TimePoint now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Output(const std::vector<uint8_t>& data, TimePoint now)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void StopOutput() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Reply(uint8_t label, const std::vector<uint8_t>& data) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  DmxProOptions options_ ABSL_GUARDED_BY(mutex_);
  DmxFixtures fixtures_ ABSL_GUARDED_BY(mutex_);

  std::vector<uint8_t> message_ ABSL_GUARDED_BY(mutex_);  // the one that is arriving
  std::deque<uint8_t> to_host_ ABSL_GUARDED_BY(mutex_);

  bool sending_ ABSL_GUARDED_BY(mutex_) = false;
  TimePoint first_ ABSL_GUARDED_BY(mutex_){};  // packet's begin since it sends
  Duration period_ ABSL_GUARDED_BY(mutex_){};
  std::deque<Packet> pending_ ABSL_GUARDED_BY(mutex_);  // with new slots, not whole yet
};

}  // namespace lightstage::sim
