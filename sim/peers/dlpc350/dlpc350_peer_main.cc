// dlpc350-peer: the simulated DLPC350 as a USB HID device of this machine, for drivers to be tried without a projector.
//
//   dlpc350-peer SERIAL
//
// Needs /dev/uhid. Says "ready" when the kernel has taken it. Lines on its input: "nack 1A24", "ignore 1A07", "short", "park", "stop", "silent",
// "errors C0", "well" (no fault), "standby", "light" (prints the pattern on the wall). Ends, unplugged, at the input's end. Images 0 to 3 hold,
// at depth 1, the squares of an 8 x 8 grid by row, then column.
#include <fcntl.h>
#include <linux/input.h>
#include <linux/uhid.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "sim/peers/dlpc350/device.h"

namespace lightstage::sim {
namespace {

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

std::map<FlashPlace, Pattern> Flash() {
  std::map<FlashPlace, Pattern> flash;
  Pattern square;
  square.arrangement = PatternArrangement::kSquare;
  square.grid = 8;
  for (int i = 0; i < 64; ++i) {
    square.row = i / 8;
    square.column = i % 8;
    flash[{i / 24, i % 24, 1}] = square;
  }
  return flash;
}

bool Tell(int uhid, const uhid_event& event) {
  if (write(uhid, &event, sizeof event) == static_cast<ssize_t>(sizeof event)) return true;
  std::perror("dlpc350-peer: /dev/uhid");
  return false;
}

void SendReplies(int uhid, Dlpc350Device& device) {
  bool unplugged = false;
  while (auto report = device.Send(Duration::zero(), &unplugged)) {
    uhid_event event{};
    event.type = UHID_INPUT2;
    event.u.input2.size = static_cast<__u16>(report->size());
    std::memcpy(event.u.input2.data, report->data(), report->size());
    if (!Tell(uhid, event)) return;
  }
}

void Obey(const std::string& line, Dlpc350Device& device) {
  Dlpc350Device::Faults faults;
  const size_t space = line.find(' ');
  const std::string word = line.substr(0, space);
  const int code =
      space == std::string::npos
          ? -1
          : static_cast<int>(std::strtol(line.c_str() + space + 1, nullptr, 16) & 0xFFFF);
  if (word == "light") {
    std::printf("light %s\n", PatternName(device.OnWall()).c_str());
    std::fflush(stdout);
    return;
  }
  if (word == "standby") return device.PowerCycle(true);
  if (word == "nack") faults.nack = code;
  if (word == "ignore") faults.ignored = code;
  if (word == "short") faults.short_reports = true;
  if (word == "park") faults.parked = true;
  if (word == "stop") faults.sequencer_stopped = true;
  if (word == "silent") faults.silent = true;
  if (word == "errors") faults.hardware_errors = static_cast<uint8_t>(code);
  device.SetFaults(faults);
}

int Main(const char* serial) {
  const int uhid = open("/dev/uhid", O_RDWR | O_CLOEXEC);
  if (uhid < 0) {
    std::perror("dlpc350-peer: /dev/uhid");
    return 1;
  }
  Dlpc350Device device(nullptr, Flash());
  uhid_event create{};
  create.type = UHID_CREATE2;
  std::snprintf(reinterpret_cast<char*>(create.u.create2.name), sizeof create.u.create2.name,
                "Texas Instruments DLPC350");
  std::snprintf(reinterpret_cast<char*>(create.u.create2.uniq), sizeof create.u.create2.uniq, "%s",
                serial);
  create.u.create2.rd_size = sizeof kDescriptor;
  std::memcpy(create.u.create2.rd_data, kDescriptor, sizeof kDescriptor);
  create.u.create2.bus = BUS_USB;
  create.u.create2.vendor = 0x0451;
  create.u.create2.product = 0x6401;
  if (!Tell(uhid, create)) return 1;
  std::string line;
  while (true) {
    pollfd both[] = {{uhid, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    if (poll(both, 2, -1) < 0 && errno != EINTR) break;
    if (both[0].revents & POLLIN) {
      uhid_event event{};
      if (read(uhid, &event, sizeof event) <= 0) break;
      if (event.type == UHID_START) {
        std::printf("ready\n");
        std::fflush(stdout);
      } else if (event.type == UHID_OUTPUT) {
        // What comes through hidraw has the report's number, 0, before it.
        const uint8_t* data = event.u.output.data;
        size_t size = std::min<size_t>(event.u.output.size, sizeof event.u.output.data);
        if (size == Dlpc350Device::kReportSize + 1 && data[0] == 0) {
          ++data;
          --size;
        }
        device.Receive({data, size});
        SendReplies(uhid, device);
      }
    }
    if (both[1].revents & (POLLIN | POLLHUP)) {
      char c = 0;
      if (read(STDIN_FILENO, &c, 1) != 1) break;
      if (c != '\n') {
        line += c;
        continue;
      }
      Obey(line, device);
      line.clear();
    }
  }
  uhid_event destroy{};
  destroy.type = UHID_DESTROY;
  Tell(uhid, destroy);
  close(uhid);
  return 0;
}

}  // namespace
}  // namespace lightstage::sim

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: dlpc350-peer SERIAL\n");
    return 2;
  }
  return lightstage::sim::Main(argv[1]);
}
