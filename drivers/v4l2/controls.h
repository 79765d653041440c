// A camera's controls: ranges, setting with read-back, and turning off everything that is automatic. One thread.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <string>

#include "drivers/v4l2/video_port.h"

namespace lightstage {

// Something that a camera does by itself and must not.
struct AutomaticControl {
  uint32_t id = 0;
  const char* name = "";  // in the rig file's leave_automatic
  int64_t off = 0;        // the value that turns it off
};

// Several may have the same name. In the order in which they are turned off.
std::span<const AutomaticControl> AutomaticControls();

struct ControlRange {
  uint32_t id = 0;
  std::string name;  // as the camera calls it
  int64_t min = 0, max = 0, step = 1, default_value = 0;
  bool is_64_bit = false, read_only = false, inactive = false;

  // The nearest value that the control takes.
  int64_t Fit(int64_t value) const;
};

class VideoControls {
 public:
  // The port outlives it.
  explicit VideoControls(const VideoPort& port) : port_(port) {}

  // Nothing if the camera has no such control or it is disabled.
  absl::StatusOr<std::optional<ControlRange>> Find(uint32_t id) const;
  absl::StatusOr<int64_t> Get(const ControlRange& control) const;
  // Sets and reads back. FAILED_PRECONDITION / CONTROL_REFUSED naming the control if it has another value then.
  absl::Status Set(const ControlRange& control, int64_t value) const;

  // Turns everything automatic off, but for the names in `leave`. FAILED_PRECONDITION / CONTROL_AUTOMATIC naming the first control
  // that stays on.
  absl::Status TurnAutomaticOff(const std::set<std::string>& leave) const;

 private:
  const VideoPort& port_;
};

}  // namespace lightstage
