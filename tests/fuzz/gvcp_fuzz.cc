// Packets of GigE Vision's control protocol.
#include "drivers/aravis/gvcp.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lightstage;
  // In memory of its own size, so that reading past its end is noticed.
  const auto bytes = std::as_bytes(std::span(data, size));
  const std::vector<std::byte> packet(bytes.begin(), bytes.end());
  if (const auto events = DecodeEvents(packet)) {
    HOLDS(!events->events.empty());
    HOLDS(events->events.size() * 16 + 8 <= packet.size());
    HOLDS(!events->with_data || events->events.size() == 1);
  }
  const uint16_t id = size >= 8 ? static_cast<uint16_t>(data[6] << 8 | data[7]) : 0;
  if (const auto answer = DecodeReadRegister(packet, id)) {
    HOLDS(packet.size() >= (answer->refused ? 8 : 12));
    HOLDS(!DecodeReadRegister(packet, static_cast<uint16_t>(id + 1)).has_value());
  }
  return 0;
}
