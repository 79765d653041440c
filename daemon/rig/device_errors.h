// Errors that name a device.
#pragma once

#include <string>
#include <string_view>

#include "absl/strings/match.h"
#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {

// `status` with the device's name in front, unless its driver has put it there.
inline absl::Status Named(const absl::Status& status, std::string_view device) {
  const std::string begin = absl::StrCat(std::string(device), ":");
  return absl::StartsWith(status.message(), begin) ? status : Annotate(status, device);
}

// What asking for a device that the rig file does not have answers.
inline absl::Status MissingDevice(std::string_view device, std::string_view asked) {
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_MISSING",
               absl::StrFormat("%s asked for, but the rig file has no [%s]", asked, device),
               {{"device", std::string(device)}, {"asked", std::string(asked)}});
}

}  // namespace lightstage
