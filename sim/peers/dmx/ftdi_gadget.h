// A simulated FTDI chip as a USB device (0403:6001) of this machine: a gadget of the kernel (FunctionFS) on its dummy_hcd, so that whatever
// speaks usbfs finds it. As root; before: modprobe dummy_hcd is_high_speed=0 (the driver counts on packets of 64 bytes, as an FT232R has
// them), libcomposite and usb_f_fs, and configfs mounted on /sys/kernel/config.
//
// Requests reach the device in order, and so do bytes; between the two lies what it takes to wake a thread. The IN endpoint gives nothing.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "sim/peers/dmx/usb_device.h"

struct usb_ctrlrequest;  // linux/usb/ch9.h

namespace lightstage::sim {

class FtdiGadget {
 public:
  // One at a time on a machine. Opens `device`, whose serial number the gadget says. Returns when the host has taken it. UNAVAILABLE /
  // PEER_NOT_STARTED naming the file that could not be opened or written.
  // `log`, if given, gets a line for all that the host does, from threads of the gadget:
  //   request 40 04 value 5008 index 0000 length 0
  //   bytes 64 00ff…
  static absl::StatusOr<std::unique_ptr<FtdiGadget>> Plug(
      std::shared_ptr<SimUsbDevice> device, std::function<void(const std::string&)> log = nullptr);
  ~FtdiGadget();
  FtdiGadget(const FtdiGadget&) = delete;
  FtdiGadget& operator=(const FtdiGadget&) = delete;

  // Pulls it out, or plugs it in again.
  absl::Status Attach(bool in);

 private:
  FtdiGadget() = default;
  absl::Status Describe(const std::string& serial);
  void Serve();    // requests
  void Receive();  // bytes
  void Answer(const usb_ctrlrequest& setup);

  std::shared_ptr<SimUsbDevice> device_;  // with the rig's peer
  std::unique_ptr<dmx::UsbPort> chip_;
  std::function<void(const std::string&)> log_;
  std::atomic<bool> quit_{false}, enabled_{false};
  int ep0_ = -1, out_ = -1;
  std::thread requests_, bytes_;
};

}  // namespace lightstage::sim
