// dlpc350-peer: the simulated DLPC350 as a USB HID device of this machine, for drivers to be tried without a projector.
//
//   dlpc350-peer SERIAL
//
// Needs /dev/uhid. Says "ready" when its hidraw node is there. Lines on its input: "nack 1A24", "ignore 1A07", "short", "park", "stop", "silent",
// "errors C0", "well" (no fault), "standby", "unplug", "plug" (which says "ready" again), "light" (prints the pattern on the wall). Ends, unplugged, at the input's end. Images 0 to 3 hold,
// at depth 1, the squares of an 8 x 8 grid by row, then column.
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <map>
#include <memory>
#include <string>

#include "base/status.h"
#include "sim/peers/dlpc350/device.h"
#include "sim/peers/dlpc350/uhid_device.h"

namespace lightstage::sim {
namespace {

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

using Plugged = std::unique_ptr<UhidDevice>;

void Plug(Dlpc350Device& device, const std::string& serial, Plugged& plugged) {
  auto now = UhidDevice::Plug(device, serial);
  if (!now.ok()) {
    std::fprintf(stderr, "dlpc350-peer: %s\n", MessageOf(now.status()).c_str());
    return;
  }
  plugged = *std::move(now);
  std::printf("ready\n");
  std::fflush(stdout);
}

void Obey(const std::string& line, Dlpc350Device& device, const std::string& serial,
          Plugged& plugged) {
  Dlpc350Device::Faults faults;
  const size_t space = line.find(' ');
  const std::string word = line.substr(0, space);
  const int code =
      space == std::string::npos
          ? -1
          : static_cast<int>(std::strtol(line.c_str() + space + 1, nullptr, 16) & 0xFFFF);
  if (word == "light") {
    std::printf("light %s\n", PatternName(device.OnWall().value()).c_str());
    std::fflush(stdout);
    return;
  }
  if (word == "standby") return device.PowerCycle(true);
  if (word == "unplug") return plugged.reset();
  if (word == "plug") return Plug(device, serial, plugged);
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
  Dlpc350Device device(nullptr, Flash());
  Plugged plugged;
  Plug(device, serial, plugged);
  if (plugged == nullptr) return 1;
  for (std::string line; std::getline(std::cin, line);) Obey(line, device, serial, plugged);
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
