// What the screen process says.
#include <string>

#include "base/status.h"
#include "drivers/display/screen_wire.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lightstage;
  fuzz::Input in(data, size);
  const absl::StatusOr<ScreenInfo> reply = ParseScreenReply(in.text());
  // What was understood is said in the same words, if it is short enough to be said.
  const std::string said = EncodeScreenReply(reply);
  HOLDS(said.size() <= kMaxScreenReply);
  const absl::StatusOr<ScreenInfo> again = ParseScreenReply(said);
  HOLDS(again.ok() == reply.ok());
  HOLDS(EncodeScreenReply(again) == said);
  if (reply.ok()) {
    HOLDS(reply->width > 0 && reply->height > 0 && reply->refresh_hz >= 0);
    HOLDS(again->width == reply->width && again->height == reply->height);
    HOLDS(again->refresh_hz == reply->refresh_hz && again->paced == reply->paced);
  } else {
    HOLDS(again.status().code() == reply.status().code());
  }
  // A reply that was cut is none.
  if (reply.ok()) HOLDS(!ParseScreenReply(in.text().substr(0, in.size() - 1)).ok());
  return 0;
}
