#include "drivers/canopen/cia402.h"

#include "absl/strings/str_format.h"

namespace lightstage::canopen {
namespace {

struct StateBits {
  uint16_t mask, value;
  DriveState state;
};

constexpr StateBits kStates[] = {
    {0x4F, 0x00, DriveState::kNotReady},         {0x4F, 0x40, DriveState::kSwitchOnDisabled},
    {0x6F, 0x21, DriveState::kReadyToSwitchOn},  {0x6F, 0x23, DriveState::kSwitchedOn},
    {0x6F, 0x27, DriveState::kOperationEnabled}, {0x6F, 0x07, DriveState::kQuickStopActive},
    {0x4F, 0x0F, DriveState::kFaultReaction},    {0x4F, 0x08, DriveState::kFault},
};

}  // namespace

std::string_view DriveStateName(DriveState state) {
  switch (state) {
    case DriveState::kNotReady:
      return "not ready to switch on";
    case DriveState::kSwitchOnDisabled:
      return "switch on disabled";
    case DriveState::kReadyToSwitchOn:
      return "ready to switch on";
    case DriveState::kSwitchedOn:
      return "switched on";
    case DriveState::kOperationEnabled:
      return "operation enabled";
    case DriveState::kQuickStopActive:
      return "quick stop active";
    case DriveState::kFaultReaction:
      return "fault reaction active";
    case DriveState::kFault:
      return "fault";
  }
  return "unknown";
}

std::optional<DriveState> DecodeStatusword(uint16_t statusword) {
  for (const StateBits& bits : kStates) {
    if ((statusword & bits.mask) == bits.value) return bits.state;
  }
  return std::nullopt;
}

std::optional<uint16_t> StepToOperationEnabled(DriveState state) {
  switch (state) {
    case DriveState::kSwitchOnDisabled:
      return kControlShutdown;
    case DriveState::kReadyToSwitchOn:
      return kControlSwitchOn;
    case DriveState::kSwitchedOn:
      return kControlEnable;
    case DriveState::kQuickStopActive:
      // The way straight back (transition 16) is one that drives need not have.
      return kControlDisableVoltage;
    case DriveState::kNotReady:
    case DriveState::kOperationEnabled:
    case DriveState::kFaultReaction:
    case DriveState::kFault:
      return std::nullopt;
  }
  return std::nullopt;
}

HomingState DecodeHoming(uint16_t statusword) {
  switch (statusword & 0x3400) {
    case 0x0000:
      return HomingState::kRunning;
    case 0x0400:
      return HomingState::kNotStarted;
    case 0x1000:
      return HomingState::kAttained;
    case 0x1400:
      return HomingState::kDone;
    case 0x2000:
      return HomingState::kErrorMoving;
    case 0x2400:
      return HomingState::kError;
    default:
      return HomingState::kReserved;
  }
}

std::string_view HomingStateName(HomingState state) {
  switch (state) {
    case HomingState::kRunning:
      return "running";
    case HomingState::kNotStarted:
      return "not started or interrupted";
    case HomingState::kAttained:
      return "attained, not yet at rest";
    case HomingState::kDone:
      return "done";
    case HomingState::kErrorMoving:
      return "error, still moving";
    case HomingState::kError:
      return "error";
    case HomingState::kReserved:
      return "reserved";
  }
  return "unknown";
}

std::string ProfileText(uint32_t device_type) {
  const auto profile = static_cast<uint16_t>(device_type);
  const char* what = "a device without a profile";
  std::string other;
  if (profile == kProfileDrive) {
    what = "a CiA 402 drive";
  } else if (profile == kProfileIo) {
    what = "a CiA 401 I/O module";
  } else if (profile != 0) {
    other = absl::StrFormat("a CiA %d device", profile);
    what = other.c_str();
  }
  return absl::StrFormat("%s (device type %08Xh)", what, device_type);
}

}  // namespace lightstage::canopen
