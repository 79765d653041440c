// What asking for a device that the rig file does not have answers.
#pragma once

#include <string>
#include <string_view>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {

inline absl::Status MissingDevice(std::string_view device, std::string_view asked) {
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_MISSING",
               absl::StrFormat("%s asked for, but the rig file has no [%s]", asked, device),
               {{"device", std::string(device)}, {"asked", std::string(asked)}});
}

}  // namespace lightstage
