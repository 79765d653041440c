// USB/IP as the simulated camera hears it, and its control requests.
#include <algorithm>

#include "sim/peers/uvc/usbip.h"
#include "sim/peers/uvc/uvc_camera.h"
#include "tests/fuzz/fuzz.h"

namespace lightstage {
namespace {

using fuzz::Input;

void Header(Input in) {
  sim::UsbipHeader header = {};
  const std::vector<uint8_t> bytes = in.Take(header.size());
  std::copy(bytes.begin(), bytes.end(), header.begin());
  const absl::StatusOr<sim::UsbipCommand> command = sim::ParseUsbipCommand(header);
  if (!command.ok()) return;
  HOLDS(command->endpoint < 16 && command->length <= 1 << 20);
  HOLDS(command->kind == sim::UsbipCommand::Kind::kSubmit || command->setup == sim::UsbSetup());
}

// Whatever it is asked, what it exposes is possible, and no answer is longer than was asked for.
void Requests(Input in) {
  using std::chrono::microseconds;
  using std::chrono::milliseconds;
  int streams = 0;
  sim::UvcCamera camera({"Fuzzed", 64, 48, 12, milliseconds(40), 0.5}, [&] { ++streams; });
  const RealClock clock;
  while (!in.empty()) {
    sim::UsbSetup setup{in.Byte(), in.Byte(), in.Word(), in.Word(), 0};
    const std::vector<uint8_t> data = in.Take(in.Byte() % 48);
    const bool asks = (setup.request_type & 0x80) != 0;
    setup.length = static_cast<uint16_t>(data.size());
    const auto answer = camera.Control(setup, asks ? std::span<const uint8_t>() : data);
    HOLDS(!answer || !asks || answer->size() <= setup.length);
    const sim::UvcCamera::Shot shot = camera.Begin(clock);
    HOLDS(shot.exposure >= microseconds(100) && shot.exposure <= milliseconds(40));
    HOLDS(shot.gain_db >= 0 && shot.gain_db <= 24);
  }
  HOLDS(camera.stream() == 0 || streams > 0);
}

}  // namespace
}  // namespace lightstage

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lightstage::fuzz::Input in(data, size);
  if (in.Choice(2) == 0) {
    lightstage::Header(in);
  } else {
    lightstage::Requests(in);
  }
  return 0;
}
