// The DLPC350's USB protocol as bytes. Pure functions; what the bytes mean is from TI's DLPC350 Programmer's Guide (DLPU010) as quoted in TI's own
// host software (dlpc350_api.cpp, 2015), except where said.
//
// A message is a header of four bytes – flags, sequence, length (16 bits, least significant first) – and `length` bytes: command (CMD3,
// then CMD2) and data. It goes in reports of 64 bytes, the last one padded: only the first has the header (§1.2). Replies have the same
// header; theirs is followed by data alone.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace lightstage::dlpc350 {

inline constexpr size_t kReportSize = 64;
using Report = std::array<uint8_t, kReportSize>;

struct Command {
  uint8_t cmd2, cmd3;
  std::string_view name;
  bool slow = false;  // it is acknowledged at once, and comes into force later
};

inline constexpr Command kPower{0x02, 0x00, "power control"};  // 0 normal, 1 standby
inline constexpr Command kVersion{0x02, 0x05, "firmware version"};
inline constexpr Command kLedCurrent{0x0B, 0x01, "LED currents"};
inline constexpr Command kLedPolarity{0x1A, 0x05, "LED PWM polarity"};  // 0 normal
inline constexpr Command kLedEnable{0x1A, 0x07, "LED enable"};
inline constexpr Command kHardwareStatus{0x1A, 0x0A, "hardware status"};
inline constexpr Command kSystemStatus{0x1A, 0x0B, "system status"};
inline constexpr Command kMainStatus{0x1A, 0x0C, "main status"};
inline constexpr Command kValidate{0x1A, 0x1A, "validation of the pattern sequence"};
inline constexpr Command kMode{0x1A, 0x1B, "display mode", true};  // 0 video, 1 patterns
inline constexpr Command kTriggerOut1{0x1A, 0x1D, "trigger out 1"};
inline constexpr Command kTriggerOut2{0x1A, 0x1E, "trigger out 2"};
inline constexpr Command kSource{0x1A, 0x22, "source of patterns"};  // 0 video port, 3 flash
inline constexpr Command kTriggerMode{0x1A, 0x23,
                                      "pattern trigger mode"};  // 1: internal or external
inline constexpr Command kStartStop{0x1A, 0x24, "start and stop of patterns", true};
inline constexpr Command kExposure{0x1A, 0x29, "exposure and period"};
inline constexpr Command kLutConfig{0x1A, 0x31, "pattern LUT configuration"};
inline constexpr Command kMailboxAddress{0x1A, 0x32, "mailbox address"};
inline constexpr Command kMailbox{0x1A, 0x33, "mailbox"};  // 0 closed, 1 image indices, 2 patterns
inline constexpr Command kMailboxData{0x1A, 0x34, "mailbox data"};
inline constexpr Command kTriggerIn1Delay{0x1A, 0x35, "trigger in 1 delay"};

// A message that sets something and wants an acknowledgement.
std::vector<Report> EncodeWrite(const Command& command, uint8_t sequence,
                                std::span<const uint8_t> data);
// A message that asks for something.
Report EncodeRead(const Command& command, uint8_t sequence);

// The longest reply that is believed; the controller's buffer has 512 bytes (as the DLPC900's, DLPU018 §1.2).
inline constexpr size_t kMaxReply = 512;

struct ReplyHead {
  uint8_t sequence = 0;
  bool nack = false;   // unknown command, or it failed
  bool read = false;   // answers EncodeRead()
  size_t length = 0;   // bytes of data
  size_t reports = 1;  // that the reply takes, this one included
};

// The header of a reply's first report. DATA_LOSS / REPORT_SHORT unless it has 64 bytes; DATA_LOSS / REPLY_LENGTH above kMaxReply.
absl::StatusOr<ReplyHead> ParseReplyHead(std::span<const uint8_t> report);

// The data of a whole reply, its reports one after the other. Errors as above, and DATA_LOSS / REPLY_LENGTH if there are fewer reports
// than the header says.
absl::StatusOr<std::vector<uint8_t>> ParseReply(std::span<const uint8_t> reports);

// ---- What is in the data

struct StatusBits {
  uint8_t hardware = 0, system = 0, main = 0;
  bool parked() const { return main & 1; }
  bool running() const { return main & 2; }
  bool frozen() const { return main & 4; }  // video: the picture is held
};

// What is wrong by §2.1.1 to §2.1.3; empty: nothing. What parked, stopped and frozen mean depends on what was asked for, so they are not here.
std::string DescribeErrors(const StatusBits& status);

// The answer to a validation: bit 7 while it is not done.
inline constexpr uint8_t kValidationBusy = 0x80;
// What bits 0 to 4 say; empty: all is valid.
std::string DescribeValidation(uint8_t bits);

// Major, minor, patch of the application's software in the answer to kVersion: "3.1.0". DATA_LOSS / REPLY_LENGTH below 4 bytes.
absl::StatusOr<std::string> ParseVersion(std::span<const uint8_t> data);

// One step of a pattern sequence.
struct LutEntry {
  int trigger = 0;  // 0 internal, 1 external rising, 2 external falling, 3 with the one before
  int number = 0;   // which bit planes of the image, by depth; 0 to 24
  int depth = 1;    // bits, 1 to 8
  int leds = 7;     // 1 red, 2 green, 4 blue
  bool invert = false;
  bool black = false;  // black after it; takes 230 µs
  bool swap = false;   // loads the next image first
  bool trigger_out_before = false;
  bool operator==(const LutEntry&) const = default;
};
std::array<uint8_t, 3> EncodeLutEntry(const LutEntry& entry);
LutEntry DecodeLutEntry(std::span<const uint8_t, 3> bytes);

std::array<uint8_t, 8> EncodeExposure(uint32_t exposure_us, uint32_t period_us);

// 0xBB is no delay; every step adds 107.2 ns: −20.05 µs to +2.787 µs.
uint8_t EncodeTriggerOutDelay(double delay_us);
std::array<uint8_t, 4> EncodeTriggerInDelay(double delay_us);  // 0 to 56 204 µs

}  // namespace lightstage::dlpc350
