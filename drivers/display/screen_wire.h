// What the driver and its screen process say to each other, one packet a message. The driver asks; every question gets one reply, and
// the first reply comes unasked, when the window is open or could not be opened.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace lightstage {

// The questions, one byte each: show what is in the shared memory.
inline constexpr char kShowRequest = 'S';
// … and whether it has been there all the time since.
inline constexpr char kCheckRequest = 'C';

// The process' end of the socket and the shared memory: width · height pixels of 32 bits, 0x00RRGGBB, top row first.
inline constexpr int kScreenSocket = 3, kScreenMemory = 4;
// It ends with this if the connection to the X server broke.
inline constexpr int kDisplayGoneExit = 3;

// An output as it stands.
struct ScreenInfo {
  std::string output;  // its name
  int width = 0, height = 0;
  double refresh_hz = 0;  // 0: not known
  std::string renderer;   // SDL's name of what draws
  bool paced = false;     // presenting waits for the output's refresh
  std::string note;       // something odd that a person should know; mostly empty
};

std::string EncodeScreenReply(const absl::StatusOr<ScreenInfo>& reply);

// INTERNAL / SCREEN_REPLY if `text` is no reply; else what it says, an error as it was encoded (without metadata).
absl::StatusOr<ScreenInfo> ParseScreenReply(std::string_view text);

// The longest reply.
inline constexpr size_t kMaxScreenReply = 8192;

}  // namespace lightstage
