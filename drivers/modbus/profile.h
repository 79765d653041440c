// A drive as data: which registers it has and what they mean. Profiles are TOML; README.md has their keys. Those of profiles/ are part of
// the binary.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "base/clock.h"
#include "drivers/modbus/values.h"

namespace lightstage {

// A number that can be read. Input registers are read with function 4, holding registers with function 3.
struct NumberRegister {
  uint16_t address = 0;
  NumberFormat format;
  bool input = false;
};

enum class VelocityUnit { kStepsPerS, kRevPerS, kRpm };
// kMsToRpm: the time in ms that the motor takes from standstill to `to_rpm`.
enum class AccelerationUnit { kStepsPerS2, kRevPerS2, kRpmPerS, kMsToRpm };

// A speed or acceleration as the drive takes it: register value = quantity in `unit` · scale, from `min` to `max`.
template <class Unit>
struct RateFormat {
  NumberFormat format;
  Unit unit{};
  double scale = 1;
  int64_t min = 1, max = 0;
  double to_rpm = 0;
};

// One write of consecutive registers, and the wait after it.
struct WriteStep {
  enum class Kind { kWord, kPosition, kVelocity, kAcceleration };
  struct Value {
    Kind kind = Kind::kWord;
    uint16_t word = 0;
  };
  uint16_t address = 0;
  std::vector<Value> values;  // numbers take as many registers as their format has
  bool single = false;        // one register with function 6; else function 16
  Duration wait{};
};

struct StatusBits {
  NumberRegister value;
  // Masks; 0: the drive has none.
  uint32_t moving = 0;       // it moves if any of them is set …
  uint32_t standing = 0;     // … or unless all of these are (one of the two is given)
  uint32_t in_position = 0;  // at rest all of them are set
  uint32_t fault = 0;        // any
  uint32_t homing = 0;       // any, while it homes
  uint32_t homed = 0;        // all
  // `homed` always says whether the position is referenced. Else it does so only when homing has ended, and the driver remembers.
  bool homed_live = false;
};

struct DriveProfile {
  std::string name;          // as it was selected
  std::string model;         // maker and family
  double steps_per_rev = 0;  // of the motor as delivered; 0: not said
  NumberRegister position;
  StatusBits status;
  std::optional<NumberRegister> fault_code;
  std::map<int64_t, std::string> fault_names;
  std::optional<NumberRegister> serial;
  NumberFormat target;
  RateFormat<VelocityUnit> velocity;
  RateFormat<AccelerationUnit> acceleration;
  std::vector<WriteStep> start;  // makes it ready to move: enables it
  std::vector<WriteStep> move, home, halt, clear_fault;
  std::vector<WriteStep> after_home;  // once homing has ended: sets the position
};

// INVALID_ARGUMENT with file:line:column.
absl::StatusOr<DriveProfile> ParseDriveProfile(std::string_view text, std::string filename);

struct ShippedProfile {
  std::string_view name, text;
};
// Of profiles/, by name.
std::span<const ShippedProfile> ShippedProfiles();

// `selected` is the name of a shipped one, or a file ending in .toml, relative to `directory`. NOT_FOUND / PROFILE_UNKNOWN.
absl::StatusOr<DriveProfile> LoadDriveProfile(const std::string& selected,
                                              const std::string& directory);

// What the registers take. steps_per_rev > 0 where the unit needs it. Nothing if it is out of the format's `min` and `max`.
// Velocities are rounded down, accelerations to the gentler side.
std::optional<int64_t> VelocityValue(const DriveProfile& profile, double steps_per_s,
                                     double steps_per_rev);
std::optional<int64_t> AccelerationValue(const DriveProfile& profile, double steps_per_s2,
                                         double steps_per_rev);
bool NeedsStepsPerRev(const DriveProfile& profile);

// The registers of a step. Numbers must be in their formats' ranges: nothing if not.
struct MoveValues {
  int64_t position = 0, velocity = 0, acceleration = 0;
};
std::optional<std::vector<uint16_t>> EncodeStep(const DriveProfile& profile, const WriteStep& step,
                                                const MoveValues& values);

}  // namespace lightstage
