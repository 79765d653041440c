// The state machine of CiA 402 drives (IEC 61800-7-201): what a statusword says, and which controlword leads on. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace lightstage::canopen {

enum class DriveState {
  kNotReady,          // starts up by itself
  kSwitchOnDisabled,  // no power
  kReadyToSwitchOn,
  kSwitchedOn,
  kOperationEnabled,  // holds and moves
  kQuickStopActive,
  kFaultReaction,  // on the way to kFault by itself
  kFault
};
std::string_view DriveStateName(DriveState state);

// Of every statusword there is exactly one, but for bit patterns that the standard does not have: nothing.
std::optional<DriveState> DecodeStatusword(uint16_t statusword);

// Bits of the statusword 6041h.
constexpr uint16_t kStatusRemote = 0x0200, kStatusTargetReached = 0x0400,
                   kStatusInternalLimit = 0x0800, kStatusModeBit12 = 0x1000,
                   kStatusModeBit13 = 0x2000;
// Profile position mode: bit 12 acknowledges a set-point, bit 13 is the following error.
constexpr uint16_t kStatusSetpointAcknowledged = kStatusModeBit12,
                   kStatusFollowingError = kStatusModeBit13;
// Profile velocity mode: bit 13 is the maximum slippage error.
constexpr uint16_t kStatusSlips = kStatusModeBit13;

// Controlwords 6040h.
constexpr uint16_t kControlDisableVoltage = 0x0000, kControlQuickStop = 0x0002,
                   kControlShutdown = 0x0006, kControlSwitchOn = 0x0007, kControlEnable = 0x000F,
                   kControlFaultReset = 0x0080;
// Bits that go with kControlEnable.
constexpr uint16_t kControlNewSetpoint = 0x0010, kControlAtOnce = 0x0020, kControlHalt = 0x0100,
                   kControlStartHoming = 0x0010;

// The controlword that leads from `state` one step towards operation enabled; nothing where the drive goes on by itself, stands in
// a fault (a rising edge of kControlFaultReset leads out of it), or is there.
std::optional<uint16_t> StepToOperationEnabled(DriveState state);

enum class HomingState {
  kRunning,
  kNotStarted,  // or interrupted
  kAttained,    // found, but not yet at rest there
  kDone,
  kErrorMoving,  // failed, and still moves
  kError,        // failed, stands
  kReserved
};
// Statusword bits 13, 12 and 10 in homing mode (mask 3400h).
HomingState DecodeHoming(uint16_t statusword);
std::string_view HomingStateName(HomingState state);

// Modes of operation 6060h. In 6502h, the supported ones, mode m is bit m - 1.
constexpr int8_t kModeProfilePosition = 1, kModeProfileVelocity = 3, kModeHoming = 6;

// Object 1000h, lower half: the device profile.
constexpr uint16_t kProfileIo = 401, kProfileDrive = 402;
std::string ProfileText(uint32_t device_type);  // "a CiA 402 drive (device type 00020192h)"

}  // namespace lightstage::canopen
