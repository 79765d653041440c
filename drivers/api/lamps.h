// The lamps of a brace, as one device with one level per lamp.
#pragma once

#include <variant>
#include <vector>

#include "drivers/api/device.h"

namespace lightstage {

struct LampsInfo {
  DeviceIdentity identity;
  int count = 0;  // lamps 0 … count−1
  int steps = 0;  // distinct levels above dark: 1 for relays, 255 for 8 bit, 0 if continuous
  Duration
      settle{};  // from the command until the light is at its level; part of every Set and Dark
  Duration
      max_time_to_dark{};  // longest the device's own dark-man timer can be set to; 0: it has none
};

struct LampsState {
  std::vector<float> levels;  // by lamp, [0,1], as the device confirmed them
};

class Lamps {
 public:
  virtual ~Lamps() = default;

  virtual const LampsInfo& info() const = 0;

  // Sets every lamp at once: `levels` has one entry per lamp. Completes when the device has confirmed and the light has settled,
  // with the levels it really took (quantised). INVALID_ARGUMENT / LAMP_LEVEL if the size or a value is wrong.
  virtual void Set(const std::vector<float>& levels, TimePoint deadline,
                   Completion<LampsState> done) = 0;

  // Any thread. All lamps off; a Set in progress completes with CANCELLED first.
  virtual void Dark(TimePoint deadline, Completion<LampsState> done) = 0;

  // Says OK if the device has all the time since the last Set or Dark been what that confirmed, as far as it can tell when it is asked
  // anew; else what is not. For after an exposure. Does not disturb it. The default is for devices that cannot change unnoticed.
  virtual void Check(TimePoint deadline, Completion<std::monostate> done);

  // The device goes dark by itself `time` after the last Set or Refresh (0: never), so that a dead daemon leaves no light on.
  // OUT_OF_RANGE / TIME_TO_DARK above max_time_to_dark.
  virtual absl::Status SetTimeToDark(Duration time) = 0;

  // Any thread. Restarts the time-to-dark; cheap.
  virtual absl::Status Refresh() = 0;
};

// INVALID_ARGUMENT / LAMP_LEVEL unless there is one finite level in [0,1] per lamp.
absl::Status CheckLevels(const LampsInfo& info, const std::vector<float>& levels);

}  // namespace lightstage
