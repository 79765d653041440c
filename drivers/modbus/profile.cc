#include "drivers/modbus/profile.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "base/status.h"
#include "base/toml.h"

namespace lightstage {
namespace {

constexpr size_t kMostSteps = 16;
constexpr size_t kMostNames = 512;
constexpr uintmax_t kMostBytes = 256 << 10;
// Modbus application protocol V1.1b3, 6.12: registers of one write.
constexpr size_t kMostRegisters = 123;

// A number as people write it, in decimal or after 0x.
std::optional<int64_t> ParseNumber(std::string_view text) {
  int64_t value = 0;
  if (text.starts_with("0x") || text.starts_with("0X")) {
    if (text.size() > 10 || !absl::SimpleHexAtoi(AbslView(text), &value)) return std::nullopt;
    return value;
  }
  if (!absl::SimpleAtoi(AbslView(text), &value)) return std::nullopt;
  return value;
}

WordOrder OrderOf(const TomlTable& table, std::optional<std::string> fallback) {
  return table.OneOf("order", {"high_first", "low_first"}, std::move(fallback)) == "low_first"
             ? WordOrder::kLowFirst
             : WordOrder::kHighFirst;
}

class Reader {
 public:
  explicit Reader(const TomlTable& root)
      : root_(root), order_(root.OneOf("order", {"high_first", "low_first"})) {}

  DriveProfile Read() {
    DriveProfile profile;
    profile.model = root_.String("model");
    if (profile.model.empty() && root_.Has("model")) root_.ErrorAt("model", "must not be empty");
    profile.steps_per_rev = root_.Double("steps_per_rev", 1, 1e9, 0.0);
    profile.position = Number(root_.Table("position", true), 2, true);
    profile.status = Status(root_.Table("status", true));
    if (root_.Has("fault")) Fault(root_.Table("fault"), profile);
    if (root_.Has("serial")) profile.serial = Number(root_.Table("serial"), 2, false);
    profile.target = Format(root_.Table("target"), 2, true);
    profile.velocity = Velocity(root_.Table("velocity", true));
    profile.acceleration = Acceleration(root_.Table("acceleration", true));
    profile.start = Steps("start", profile, false);
    profile.move = Steps("move", profile, true);
    profile.home = Steps("home", profile, true);
    profile.after_home = Steps("after_home", profile, false);
    profile.halt = Steps("halt", profile, true);
    profile.clear_fault = Steps("clear_fault", profile, false);
    CheckMove(profile);
    return profile;
  }

 private:
  NumberFormat Format(const TomlTable& table, int words, bool is_signed) {
    NumberFormat format;
    format.words = static_cast<int>(table.Int("words", 1, 2, words));
    format.order = OrderOf(table, order_);
    format.is_signed = table.Bool("signed", is_signed);
    return format;
  }

  NumberRegister Number(const TomlTable& table, int words, bool is_signed) {
    NumberRegister number;
    number.format = Format(table, words, is_signed);
    number.address = static_cast<uint16_t>(table.Int("register", 0, 0x10000 - number.format.words));
    number.input = table.Bool("input", false);
    return number;
  }

  StatusBits Status(const TomlTable& table) {
    StatusBits status;
    status.value = Number(table, 1, false);
    if (status.value.format.is_signed) table.ErrorAt("signed", "bits have no sign");
    const int64_t all = status.value.format.words == 1 ? 0xFFFF : 0xFFFFFFFF;
    auto mask = [&](const char* key, bool required) {
      return static_cast<uint32_t>(
          table.Int(key, 1, all, required ? std::nullopt : std::optional<int64_t>(0)));
    };
    if (table.Has("moving") == table.Has("standing")) {
      table.ErrorAt(table.Has("moving") ? "standing" : "",
                    "needs one of moving (it moves if any of these bits is set) and standing (it "
                    "stands if all of these are)");
    }
    status.moving = mask("moving", false);
    status.standing = mask("standing", false);
    status.in_position = mask("in_position", false);
    status.fault = mask("fault", true);
    status.homing = mask("homing", false);
    status.homed = mask("homed", false);
    status.homed_live = table.Bool("homed_live", false);
    if (status.homed_live && status.homed == 0) {
      table.ErrorAt("homed_live", "needs homed, the bits that say so");
    }
    return status;
  }

  void Fault(const TomlTable& table, DriveProfile& profile) {
    profile.fault_code = Number(table, 1, false);
    const TomlTable codes = table.Table("codes");
    for (const std::string& key : codes.Keys()) {
      const std::string name = codes.String(key);
      const std::optional<int64_t> code = ParseNumber(key);
      if (!code || *code < 0 || *code > 0xFFFFFFFF) {
        codes.ErrorAt(key, "must be a fault code from 0 to 0xFFFFFFFF, such as \"0x30\"");
      } else if (!profile.fault_names.emplace(*code, name).second) {
        codes.ErrorAt(key, "this code has a name already");
      }
      if (profile.fault_names.size() > kMostNames) {
        return codes.ErrorAt(key, absl::StrCat("more than ", kMostNames, " codes"));
      }
    }
  }

  template <class Unit>
  void Rate(const TomlTable& table, RateFormat<Unit>& rate) {
    rate.format = Format(table, 1, false);
    rate.scale = table.Double("scale", 1e-9, 1e9, 1.0);
    const int64_t highest = Highest(rate.format);
    rate.min = table.Int("min", 0, highest, 1);
    rate.max = table.Int("max", 1, highest, highest);
    if (rate.min > rate.max) table.ErrorAt("min", "must not be above max");
  }

  RateFormat<VelocityUnit> Velocity(const TomlTable& table) {
    RateFormat<VelocityUnit> rate;
    Rate(table, rate);
    const std::string unit = table.OneOf("unit", {"steps_per_s", "rev_per_s", "rpm"});
    rate.unit = unit == "rpm"         ? VelocityUnit::kRpm
                : unit == "rev_per_s" ? VelocityUnit::kRevPerS
                                      : VelocityUnit::kStepsPerS;
    return rate;
  }

  RateFormat<AccelerationUnit> Acceleration(const TomlTable& table) {
    RateFormat<AccelerationUnit> rate;
    Rate(table, rate);
    const std::string unit =
        table.OneOf("unit", {"steps_per_s2", "rev_per_s2", "rpm_per_s", "ms_to_rpm"});
    rate.unit = unit == "ms_to_rpm"    ? AccelerationUnit::kMsToRpm
                : unit == "rpm_per_s"  ? AccelerationUnit::kRpmPerS
                : unit == "rev_per_s2" ? AccelerationUnit::kRevPerS2
                                       : AccelerationUnit::kStepsPerS2;
    if (unit == "ms_to_rpm") rate.to_rpm = table.Double("to_rpm", 1, 1e6);
    return rate;
  }

  std::vector<WriteStep> Steps(const char* key, const DriveProfile& profile, bool required) {
    std::vector<WriteStep> steps;
    const std::vector<TomlTable> tables = root_.Tables(key);
    if (tables.size() > kMostSteps) {
      root_.ErrorAt(key, absl::StrCat("has more than ", kMostSteps, " writes"));
      for (const TomlTable& table : tables) table.Ignore();
      return steps;
    }
    for (const TomlTable& table : tables) steps.push_back(Step(table, profile, key));
    if (required && steps.empty()) {
      root_.ErrorAt("", absl::StrCat("[[", key, "]] is missing: the writes, in their order"));
    }
    return steps;
  }

  WriteStep Step(const TomlTable& table, const DriveProfile& profile, std::string_view sequence) {
    WriteStep step;
    step.address = static_cast<uint16_t>(table.Int("register", 0, 0xFFFF));
    step.wait = table.Time("wait_ms", 0, 1000, 0.0);
    size_t registers = 0;
    const std::string values = table.String("values");
    for (const auto& piece : absl::StrSplit(values, absl::ByAnyChar(" \t\n"), absl::SkipEmpty())) {
      const std::string_view token(piece.data(), piece.size());
      WriteStep::Value value;
      if (token == "position") {
        value.kind = WriteStep::Kind::kPosition;
        registers += profile.target.words;
      } else if (token == "velocity") {
        value.kind = WriteStep::Kind::kVelocity;
        registers += profile.velocity.format.words;
      } else if (token == "acceleration") {
        value.kind = WriteStep::Kind::kAcceleration;
        registers += profile.acceleration.format.words;
      } else if (std::optional<int64_t> word = ParseNumber(token);
                 word && *word >= 0 && *word <= 0xFFFF) {
        value.word = static_cast<uint16_t>(*word);
        ++registers;
      } else {
        table.ErrorAt("values", absl::StrCat("'", token.substr(0, 40),
                                             "' must be a register's value from 0 to 0xFFFF, "
                                             "position, velocity or acceleration"));
        return step;
      }
      if (value.kind != WriteStep::Kind::kWord && sequence != "move") {
        table.ErrorAt("values", absl::StrCat(token, " is known in [[move]] only"));
      }
      step.values.push_back(value);
      if (registers > kMostRegisters) break;
    }
    if (table.Has("values") && registers == 0) table.ErrorAt("values", "has no values");
    if (registers > kMostRegisters) {
      table.ErrorAt("values", absl::StrCat("more than ", kMostRegisters,
                                           " registers, which is what one write can hold"));
    }
    if (step.address + registers > 0x10000) {
      table.ErrorAt("register", "the last value would lie behind register 0xFFFF");
    }
    const int64_t fallback = registers == 1 ? 6 : 16;
    const int64_t function = table.Int("function", 6, 16, fallback);
    if (function != 6 && function != 16) {
      table.ErrorAt("function", "must be 6 (one register) or 16 (several)");
    } else if (function == 6 && registers > 1) {
      table.ErrorAt("function", "6 writes one register, here are more values");
    }
    step.single = function == 6;
    return step;
  }

  void CheckMove(const DriveProfile& profile) {
    auto writes = [&](WriteStep::Kind kind) {
      return std::any_of(profile.move.begin(), profile.move.end(), [&](const WriteStep& step) {
        return std::any_of(step.values.begin(), step.values.end(),
                           [&](const WriteStep::Value& value) { return value.kind == kind; });
      });
    };
    if (profile.move.empty()) return;
    if (!writes(WriteStep::Kind::kPosition)) {
      root_.ErrorAt("move", "no write of it has the position");
    }
    if (!writes(WriteStep::Kind::kVelocity)) {
      root_.ErrorAt("move", "no write of it has the velocity");
    }
  }

  const TomlTable& root_;
  const std::string order_;
};

double RevPerS(double steps_per_s, double steps_per_rev) { return steps_per_s / steps_per_rev; }

std::optional<int64_t> Within(double value, int64_t min, int64_t max) {
  if (!(value >= static_cast<double>(min) && value <= static_cast<double>(max))) {
    return std::nullopt;
  }
  return static_cast<int64_t>(value);
}

// Rounding must not be upset by what binary fractions leave: 200 rpm is 200, not 199.
constexpr double kRoundingSlack = 1e-9;

}  // namespace

absl::StatusOr<DriveProfile> ParseDriveProfile(std::string_view text, std::string filename) {
  ASSIGN_OR_RETURN(TomlDocument document, TomlDocument::Parse(text, std::move(filename)));
  DriveProfile profile = Reader(document.root()).Read();
  RETURN_IF_ERROR(document.Finish());
  return profile;
}

absl::StatusOr<DriveProfile> LoadDriveProfile(const std::string& selected,
                                              const std::string& directory) {
  if (selected.ends_with(".toml")) {
    const std::filesystem::path path = std::filesystem::path(directory) / selected;
    std::error_code error;
    const uintmax_t size = std::filesystem::file_size(path, error);
    if (error) return ErrnoError(error.value(), "reading the drive profile", path.string());
    if (size > kMostBytes) {
      return Error(
          absl::StatusCode::kInvalidArgument, "PROFILE_TOO_LARGE",
          absl::StrCat(path.string(), ": has ", size, " bytes, a profile has at most ", kMostBytes),
          {{"file", path.string()}});
    }
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    if (!file) return ErrnoError(EIO, "reading the drive profile", path.string());
    ASSIGN_OR_RETURN(DriveProfile profile, ParseDriveProfile(text.str(), path.string()));
    profile.name = selected;
    return profile;
  }
  std::vector<std::string> names;
  for (const ShippedProfile& shipped : ShippedProfiles()) {
    if (shipped.name == selected) {
      ASSIGN_OR_RETURN(DriveProfile profile,
                       ParseDriveProfile(shipped.text, absl::StrCat(selected, " (shipped)")));
      profile.name = selected;
      return profile;
    }
    names.emplace_back(shipped.name);
  }
  return Error(
      absl::StatusCode::kNotFound, "PROFILE_UNKNOWN",
      absl::StrCat("there is no drive profile \"", selected, "\"; shipped are ",
                   absl::StrJoin(names, ", "),
                   "; a file of one's own ends with .toml and is looked for beside the rig "
                   "file"),
      {{"profile", selected}});
}

bool NeedsStepsPerRev(const DriveProfile& profile) {
  return profile.velocity.unit != VelocityUnit::kStepsPerS ||
         profile.acceleration.unit != AccelerationUnit::kStepsPerS2;
}

std::optional<int64_t> VelocityValue(const DriveProfile& profile, double steps_per_s,
                                     double steps_per_rev) {
  const RateFormat<VelocityUnit>& rate = profile.velocity;
  double value = steps_per_s;
  if (rate.unit == VelocityUnit::kRevPerS) value = RevPerS(steps_per_s, steps_per_rev);
  if (rate.unit == VelocityUnit::kRpm) value = 60 * RevPerS(steps_per_s, steps_per_rev);
  value *= rate.scale;
  return Within(std::floor(value + std::max(1.0, value) * kRoundingSlack), rate.min, rate.max);
}

std::optional<int64_t> AccelerationValue(const DriveProfile& profile, double steps_per_s2,
                                         double steps_per_rev) {
  const RateFormat<AccelerationUnit>& rate = profile.acceleration;
  const double rev = RevPerS(steps_per_s2, steps_per_rev);
  if (rate.unit == AccelerationUnit::kMsToRpm) {
    const double value = 1000 * rate.to_rpm / (60 * rev) * rate.scale;
    return Within(std::ceil(value - std::max(1.0, value) * kRoundingSlack), rate.min, rate.max);
  }
  double value = steps_per_s2;
  if (rate.unit == AccelerationUnit::kRevPerS2) value = rev;
  if (rate.unit == AccelerationUnit::kRpmPerS) value = 60 * rev;
  value *= rate.scale;
  return Within(std::floor(value + std::max(1.0, value) * kRoundingSlack), rate.min, rate.max);
}

std::optional<std::vector<uint16_t>> EncodeStep(const DriveProfile& profile, const WriteStep& step,
                                                const MoveValues& values) {
  std::vector<uint16_t> words;
  for (const WriteStep::Value& value : step.values) {
    std::optional<std::vector<uint16_t>> number;
    switch (value.kind) {
      case WriteStep::Kind::kWord:
        number = std::vector<uint16_t>{value.word};
        break;
      case WriteStep::Kind::kPosition:
        number = EncodeNumber(profile.target, values.position);
        break;
      case WriteStep::Kind::kVelocity:
        number = EncodeNumber(profile.velocity.format, values.velocity);
        break;
      case WriteStep::Kind::kAcceleration:
        number = EncodeNumber(profile.acceleration.format, values.acceleration);
        break;
    }
    if (!number) return std::nullopt;
    words.insert(words.end(), number->begin(), number->end());
  }
  return words;
}

}  // namespace lightstage
