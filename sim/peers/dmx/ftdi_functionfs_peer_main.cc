// A simulated Open DMX as a USB device of this machine, which writes down, with time stamps, what a host does to it. For virtual machines:
// ftdi_gadget.h says what must be loaded before.
//
//   ftdi_functionfs_peer SERIAL SLOTS       as root
//
// Lines, times in seconds of CLOCK_MONOTONIC: "ready" when the host has taken it, "12.345678 " and what ftdi_gadget.h says while it is plugged in.
// Lines on its input: "unplug", "plug". At the input's end it is unplugged and says how many whole frames its receiver believed, and why it did
// not believe others.
#include <cstdio>
#include <iostream>
#include <string>

#include "absl/strings/numbers.h"
#include "base/status.h"
#include "sim/peers/dmx/ftdi_gadget.h"
#include "sim/peers/dmx/open_dmx.h"

namespace lightstage::sim {
namespace {

absl::Status Serve(const char* serial, int slots) {
  RealClock clock;
  DmxFixtureOptions fixtures;
  fixtures.slots = slots;
  const auto chip = std::make_shared<OpenDmx>(
      dmx::UsbIdentity{.product = "FT232R USB UART", .serial = serial}, clock, fixtures, nullptr);
  const auto log = [&](const std::string& line) {
    std::printf("%.6f %s\n", Seconds(clock.Now().time_since_epoch()), line.c_str());
  };
  {
    ASSIGN_OR_RETURN(const std::unique_ptr<FtdiGadget> gadget, FtdiGadget::Plug(chip, log));
    std::printf("ready\n");
    std::fflush(stdout);
    for (std::string line; std::getline(std::cin, line);) {
      if (line == "plug" || line == "unplug") RETURN_IF_ERROR(gadget->Attach(line == "plug"));
    }
  }
  std::printf("frames %d\n", chip->whole_frames());
  for (const std::string& why : chip->refusals()) std::printf("refused %s\n", why.c_str());
  return absl::OkStatus();
}

}  // namespace
}  // namespace lightstage::sim

int main(int argc, char** argv) {
  int slots = 0;
  if (argc != 3 || !absl::SimpleAtoi(argv[2], &slots) || slots < 1 || slots > 512) {
    std::fprintf(stderr, "usage: ftdi_functionfs_peer SERIAL SLOTS\n");
    return 2;
  }
  const absl::Status served = lightstage::sim::Serve(argv[1], slots);
  if (served.ok()) return 0;
  std::fprintf(stderr, "ftdi_functionfs_peer: %s\n", lightstage::MessageOf(served).c_str());
  return 1;
}
