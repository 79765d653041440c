// Registers and drive profiles of the driver; requests as the simulated peers read them.
#include <algorithm>

#include "drivers/modbus/profile.h"
#include "drivers/modbus/values.h"
#include "sim/peers/modbus/frames.h"
#include "tests/fuzz/fuzz.h"

namespace lightstage {
namespace {

using fuzz::Input;
using Bytes = std::vector<uint8_t>;

void Numbers(Input in) {
  const unsigned choice = in.Choice(8);
  const NumberFormat format{.words = choice % 2 == 0 ? 1 : 2,
                            .order = choice % 4 < 2 ? WordOrder::kHighFirst : WordOrder::kLowFirst,
                            .is_signed = choice >= 4};
  std::vector<uint16_t> words;
  while (!in.empty() && words.size() < 4) words.push_back(in.Word());
  const std::optional<int64_t> value = DecodeNumber(format, words);
  HOLDS(value.has_value() == (words.size() == static_cast<size_t>(format.words)));
  if (!value) return;
  HOLDS(*value >= Lowest(format) && *value <= Highest(format));
  HOLDS(EncodeNumber(format, *value) == words);
}

void CheckStep(const DriveProfile& profile, const WriteStep& step, const MoveValues& values,
               bool in_range) {
  const auto words = EncodeStep(profile, step, values);
  HOLDS(words.has_value() || !in_range);
  if (!words) return;
  // What one write can hold: MODBUS Application Protocol V1.1b3, 6.12.
  HOLDS(!words->empty() && words->size() <= 123);
  HOLDS(!step.single || words->size() == 1);
  HOLDS(step.address + words->size() <= 0x10000);
  HOLDS(step.wait >= Duration::zero());
}

void Profile(std::string_view text) {
  const absl::StatusOr<DriveProfile> profile = ParseDriveProfile(text, "fuzz.toml");
  if (!profile.ok()) return;
  HOLDS(!profile->model.empty());
  HOLDS(!profile->move.empty() && !profile->home.empty() && !profile->halt.empty());
  const auto velocity = VelocityValue(*profile, 1e4, 200);
  const auto acceleration = AccelerationValue(*profile, 1e4, 200);
  HOLDS(!velocity || (*velocity >= profile->velocity.min && *velocity <= profile->velocity.max));
  HOLDS(!acceleration ||
        (*acceleration >= profile->acceleration.min && *acceleration <= profile->acceleration.max));
  const MoveValues values{-1000, velocity.value_or(profile->velocity.min),
                          acceleration.value_or(profile->acceleration.min)};
  const bool in_range = profile->target.is_signed;
  for (const auto* steps : {&profile->start, &profile->move, &profile->home, &profile->after_home,
                            &profile->halt, &profile->clear_fault}) {
    for (const WriteStep& step : *steps) CheckStep(*profile, step, values, in_range);
  }
}

// Of a request that was believed, in all its parts.
Bytes Rebuilt(const sim::ModbusRequest& request) {
  const auto high = [](int word) { return static_cast<uint8_t>(word >> 8); };
  const auto low = [](int word) { return static_cast<uint8_t>(word); };
  Bytes pdu = {low(request.function), high(request.address), low(request.address)};
  if (request.function == 5) {
    pdu.insert(pdu.end(), {uint8_t(request.values[0] != 0 ? 0xFF : 0), 0});
  } else if (request.function == 6) {
    pdu.insert(pdu.end(), {high(request.values[0]), low(request.values[0])});
  } else {
    pdu.insert(pdu.end(), {high(request.count), low(request.count)});
  }
  if (request.function == 16) {
    pdu.push_back(low(2 * request.count));
    for (uint16_t value : request.values) pdu.insert(pdu.end(), {high(value), low(value)});
  }
  return pdu;
}

void Request(std::span<const uint8_t> pdu) {
  const sim::ParsedRequest parsed = sim::ParseRequest(17, pdu);
  HOLDS(parsed.request.has_value() == (parsed.exception == 0));
  if (!parsed.request) return;
  const sim::ModbusRequest& request = *parsed.request;
  HOLDS(request.unit == 17 && request.address >= 0 && request.address <= 0xFFFF);
  const bool several = request.function == 15 || request.function == 16;
  HOLDS(!several || request.values.size() == static_cast<size_t>(request.count));
  // The unused bits of coils are nobody's.
  if (request.function != 15) HOLDS(std::ranges::equal(Rebuilt(request), pdu));
  // Its frames are as long as their beginnings say, and the reply has room in one.
  const Bytes rtu = sim::RtuFrame(17, pdu);
  HOLDS(sim::RtuRequestLength(rtu) == rtu.size());
  const Bytes tcp = sim::TcpFrame(4711, 17, pdu);
  const auto header = sim::ParseMbap(tcp);
  HOLDS(header && header->transaction == 4711 && header->unit == 17);
  HOLDS(size_t{header->length} + 6 == tcp.size());
  sim::ModbusAnswer answer;
  if (!request.writes()) answer.values.assign(static_cast<size_t>(request.count), 0xA5A5);
  const Bytes reply = sim::ReplyPdu(request, answer);
  HOLDS(!reply.empty() && reply.size() <= 253 && reply[0] == request.function);
}

void Frames(std::span<const uint8_t> bytes) {
  const std::optional<size_t> length = sim::RtuRequestLength(bytes);
  HOLDS(length || bytes.size() < 7);
  // 256 bytes are a frame at most on the serial line, but a length byte can say more.
  HOLDS(!length || *length == 0 || (*length >= 8 && *length <= 9 + 255));
  // More bytes do not change what was said.
  for (size_t size = 0; size < std::min<size_t>(bytes.size(), 8); ++size) {
    const auto sooner = sim::RtuRequestLength(bytes.first(size));
    HOLDS(!sooner || sooner == length);
  }
  if (length && *length >= 8 && *length <= bytes.size()) {
    Request(bytes.subspan(1, *length - 3));
    // A frame with its own check sum is whole.
    const Bytes frame = sim::RtuFrame(bytes[0], bytes.subspan(1, *length - 3));
    HOLDS(sim::ModbusCrc(frame) == 0);
  }
  const auto header = sim::ParseMbap(bytes);
  HOLDS(header.has_value() == (bytes.size() >= sim::MbapHeader::kSize));
}

}  // namespace
}  // namespace lightstage

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lightstage::fuzz::Input in(data, size);
  switch (in.Choice(4)) {
    case 0:
      lightstage::Profile(in.text());
      break;
    case 1:
      lightstage::Numbers(in);
      break;
    case 2:
      lightstage::Request(in.rest());
      break;
    default:
      lightstage::Frames(in.rest());
  }
  return 0;
}
