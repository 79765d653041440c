// What a DMX USB Pro sends, and what an FTDI chip puts around it.
#include <algorithm>
#include <string>

#include "drivers/dmx/ftdi.h"
#include "drivers/dmx/pro_message.h"
#include "tests/fuzz/fuzz.h"

namespace lightstage::dmx {
namespace {

using fuzz::Input;
using Bytes = std::vector<uint8_t>;

std::vector<ProMessage> All(ProDecoder& decoder) {
  std::vector<ProMessage> messages;
  while (std::optional<ProMessage> message = decoder.Next()) {
    HOLDS(message->data.size() <= kProMaxData);
    messages.push_back(*std::move(message));
  }
  return messages;
}

bool Same(const ProMessage& a, const ProMessage& b) {
  return a.label == b.label && a.data == b.data;
}

// The stream in pieces whose lengths are the fuzzer's too.
void Stream(Input in) {
  const Bytes cuts = in.Take(in.Byte() % 16);
  const std::span<const uint8_t> stream = in.rest();

  ProDecoder whole;
  whole.Feed(stream);
  const std::vector<ProMessage> messages = All(whole);
  size_t used = 0;
  for (const ProMessage& message : messages) {
    const Bytes again = EncodePro(message.label, message.data);
    const auto at = std::search(stream.begin() + static_cast<ptrdiff_t>(used), stream.end(),
                                again.begin(), again.end());
    HOLDS(at != stream.end());
    used = static_cast<size_t>(at - stream.begin()) + again.size();
  }

  ProDecoder pieces;
  std::vector<ProMessage> found;
  size_t at = 0;
  for (size_t i = 0; at < stream.size(); ++i) {
    const size_t wanted = i < cuts.size() ? size_t{cuts[i]} : stream.size();
    const std::span<const uint8_t> piece = stream.subspan(at, std::min(wanted, stream.size() - at));
    pieces.Feed(piece);
    at += piece.size();
    for (ProMessage& message : All(pieces)) found.push_back(std::move(message));
  }
  HOLDS(std::ranges::equal(found, messages, Same));

  // Whatever came before, after a message's greatest length of nothing the next one is understood.
  whole.Feed(Bytes(kProMaxData + 5, 0));
  All(whole);
  whole.Feed(EncodeProGetSerial());
  const std::vector<ProMessage> last = All(whole);
  HOLDS(last.size() == 1 && Same(last[0], {kProGetSerial, {}}));
}

void Replies(std::span<const uint8_t> data) {
  const std::optional<ProParameters> parameters = DecodeProParameters(data);
  HOLDS(parameters.has_value() == (data.size() >= 5));
  if (parameters) {
    HOLDS(parameters->break_time >= Duration::zero());
    HOLDS(parameters->packets_per_second >= 0 && parameters->packets_per_second <= 255);
    HOLDS(ProTimeToLine(*parameters, 512) > ProTimeToLine(*parameters, 24) ||
          parameters->packets_per_second > 0);
    HOLDS(ProTimeToLine(*parameters, 24) > Duration::zero());
  }
  const std::optional<std::string> serial = DecodeProSerial(data);
  if (serial && *serial != "not programmed") {
    HOLDS(serial->size() == 8);
    HOLDS(std::ranges::all_of(*serial, [](char c) { return c >= '0' && c <= '9'; }));
  }
}

void Ftdi(std::span<const uint8_t> transfer) {
  const Bytes payload = FtdiPayload(transfer);
  const size_t packets = (transfer.size() + kFtdiPacket - 1) / kFtdiPacket;
  HOLDS(payload.size() <= transfer.size());
  HOLDS(payload.size() + 2 * packets >= transfer.size());
  // Put into packets again, it comes out again.
  Bytes packed;
  for (size_t at = 0; at < payload.size(); at += kFtdiPacket - 2) {
    packed.insert(packed.end(), {0x31, 0x60});
    const size_t count = std::min(kFtdiPacket - 2, payload.size() - at);
    const auto from = payload.begin() + static_cast<ptrdiff_t>(at);
    packed.insert(packed.end(), from, from + static_cast<ptrdiff_t>(count));
  }
  HOLDS(FtdiPayload(packed) == payload);
  const std::optional<FtdiStatus> status = DecodeFtdiStatus(transfer);
  HOLDS(status.has_value() == (transfer.size() >= 2));
  HOLDS(!status || (status->modem == transfer[0] && status->line == transfer[1]));
}

}  // namespace
}  // namespace lightstage::dmx

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  lightstage::fuzz::Input in(data, size);
  switch (in.Choice(3)) {
    case 0:
      lightstage::dmx::Stream(in);
      break;
    case 1:
      lightstage::dmx::Replies(in.rest());
      break;
    default:
      lightstage::dmx::Ftdi(in.rest());
  }
  return 0;
}
