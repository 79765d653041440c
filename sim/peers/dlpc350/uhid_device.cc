#include "sim/peers/dlpc350/uhid_device.h"

#include <fcntl.h>
#include <linux/input.h>
#include <linux/uhid.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/status.h"
#include "drivers/dlpc350/hid_port.h"
#include "spdlog/spdlog.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// One input and one output report of 64 bytes without a number, on a page of the vendor's.
constexpr uint8_t kDescriptor[] = {
    0x06, 0x00, 0xFF,  // Usage Page (Vendor Defined)
    0x09, 0x01,        // Usage (1)
    0xA1, 0x01,        // Collection (Application)
    0x15, 0x00,        //   Logical Minimum (0)
    0x26, 0xFF, 0x00,  //   Logical Maximum (255)
    0x75, 0x08,        //   Report Size (8)
    0x95, 0x40,        //   Report Count (64)
    0x09, 0x01,        //   Usage (1)
    0x81, 0x02,        //   Input (Data, Variable, Absolute)
    0x09, 0x01,        //   Usage (1)
    0x91, 0x02,        //   Output (Data, Variable, Absolute)
    0xC0,              // End Collection
};

absl::Status NotStarted(const std::string& why) {
  return Error(absl::StatusCode::kUnavailable, "PEER_NOT_STARTED",
               absl::StrCat("the simulated projector's USB: ", why));
}

bool Tell(int uhid, const uhid_event& event) {
  return write(uhid, &event, sizeof event) == static_cast<ssize_t>(sizeof event);
}

bool Listed(const std::string& serial) {
  absl::StatusOr<std::vector<dlpc350::HidDevice>> devices = dlpc350::ListHidDevices();
  return devices.ok() &&
         std::any_of(devices->begin(), devices->end(),
                     [&](const dlpc350::HidDevice& device) { return device.serial == serial; });
}

}  // namespace

absl::StatusOr<std::unique_ptr<UhidDevice>> UhidDevice::Plug(Dlpc350Device& device,
                                                             const std::string& serial) {
  const int uhid = open("/dev/uhid", O_RDWR | O_CLOEXEC);
  if (uhid < 0) {
    return NotStarted(absl::StrCat("/dev/uhid: ", std::strerror(errno), " (modprobe uhid)"));
  }
  const int quit = eventfd(0, EFD_CLOEXEC);
  std::unique_ptr<UhidDevice> plugged(new UhidDevice(device, uhid, quit));
  if (quit < 0) return NotStarted(absl::StrCat("eventfd: ", std::strerror(errno)));
  uhid_event create{};
  create.type = UHID_CREATE2;
  uhid_create2_req& what = create.u.create2;
  std::strncpy(reinterpret_cast<char*>(what.name), "Texas Instruments DLPC350",
               sizeof what.name - 1);
  std::strncpy(reinterpret_cast<char*>(what.uniq), serial.c_str(), sizeof what.uniq - 1);
  what.rd_size = sizeof kDescriptor;
  std::memcpy(what.rd_data, kDescriptor, sizeof kDescriptor);
  what.bus = BUS_USB;
  what.vendor = dlpc350::kVendor;
  what.product = dlpc350::kProduct;
  if (!Tell(uhid, create)) {
    return NotStarted(absl::StrCat("creating it: ", std::strerror(errno)));
  }
  plugged->thread_ = std::thread([device = plugged.get()] { device->Run(); });
  RealClock clock;
  const TimePoint give_up = clock.Now() + seconds(10);
  while (!Listed(serial)) {
    if (clock.Now() > give_up) {
      return NotStarted("its hidraw node did not appear (modprobe hid-generic)");
    }
    SleepFor(clock, milliseconds(20));
  }
  return plugged;
}

UhidDevice::~UhidDevice() {
  const uint64_t one = 1;
  if (thread_.joinable() && write(quit_, &one, sizeof one) == sizeof one) thread_.join();
  uhid_event destroy{};
  destroy.type = UHID_DESTROY;
  Tell(uhid_, destroy);
  close(uhid_);
  if (quit_ >= 0) close(quit_);
}

void UhidDevice::SendReplies() {
  bool unplugged = false;
  while (auto report = device_.Send(Duration::zero(), &unplugged)) {
    uhid_event event{};
    event.type = UHID_INPUT2;
    event.u.input2.size = static_cast<__u16>(report->size());
    std::memcpy(event.u.input2.data, report->data(), report->size());
    if (!Tell(uhid_, event)) {
      return spdlog::error("the simulated projector's USB: /dev/uhid: {}", std::strerror(errno));
    }
  }
}

void UhidDevice::Run() {
  while (true) {
    pollfd both[] = {{uhid_, POLLIN, 0}, {quit_, POLLIN, 0}};
    if (poll(both, 2, -1) < 0 && errno != EINTR) return;
    if (both[1].revents != 0) return;
    if ((both[0].revents & POLLIN) == 0) continue;
    uhid_event event{};
    if (read(uhid_, &event, sizeof event) <= 0) return;
    if (event.type != UHID_OUTPUT) continue;
    // What comes through hidraw has the report's number, 0, before it.
    const uint8_t* data = event.u.output.data;
    size_t size = std::min<size_t>(event.u.output.size, sizeof event.u.output.data);
    if (size == Dlpc350Device::kReportSize + 1 && data[0] == 0) {
      ++data;
      --size;
    }
    device_.Receive({data, size});
    SendReplies();
  }
}

}  // namespace lightstage::sim
