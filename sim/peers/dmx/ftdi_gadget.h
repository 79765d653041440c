// A simulated FTDI chip as a USB device (0403:6001) of this machine: a gadget of the kernel (FunctionFS) on its dummy_hcd, so that whatever
// speaks usbfs finds it. As root; before: modprobe dummy_hcd is_high_speed=0 (the driver counts on packets of 64 bytes, as an FT232R has
// them), libcomposite and usb_f_fs, and configfs mounted on /sys/kernel/config.
//
// Requests and bytes come from the kernel by two ways, each in order. What orders one after the other is that after the end of a break no
// request is served before the bytes are there that the host has sent meanwhile. The IN endpoint gives nothing.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "base/mutex.h"
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
  void AwaitBytes();

  std::shared_ptr<SimUsbDevice> device_;  // with the rig's peer
  std::unique_ptr<dmx::UsbPort> chip_;
  std::function<void(const std::string&)> log_;
  std::atomic<bool> quit_{false}, enabled_{false};
  Mutex mutex_;
  CondVar arrived_;
  bool awaited_ ABSL_GUARDED_BY(mutex_) =
      false;  // a break has ended and no whole transfer came since
  int ep0_ = -1, out_ = -1;
  std::thread requests_, bytes_;
};

}  // namespace lightstage::sim
