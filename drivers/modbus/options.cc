#include "drivers/modbus/options.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

constexpr int kMostLamps = 1024;

// What libmodbus can set; it would take 9600 for any other without a word.
const std::vector<int> kBauds = {1200,  2400,   4800,   9600,   19200, 38400,
                                 57600, 115200, 230400, 460800, 921600};

LineOptions ParseLine(const TomlTable& table) {
  LineOptions line;
  const bool host = table.Has("host"), serial = table.Has("serial_port");
  if (host == serial) {
    table.ErrorAt(
        host ? "serial_port" : "",
        "needs one of host = \"…\" (Modbus TCP) and serial_port = \"/dev/serial/by-id/…\" "
        "(Modbus RTU)");
  }
  if (host) {
    line.host = table.String("host");
    if (line.host.empty()) table.ErrorAt("host", "must be an address or a name");
    line.port = static_cast<int>(table.Int("port", 1, 65535, 502));
  }
  if (serial) {
    line.serial_port = table.String("serial_port");
    if (!line.serial_port.starts_with('/')) {
      table.ErrorAt("serial_port", "must be a path such as \"/dev/serial/by-id/…\"");
    }
    const int64_t baud = table.Int("baud", 1200, 921600);
    line.baud = static_cast<int>(baud);
    if (table.Has("baud") && std::find(kBauds.begin(), kBauds.end(), baud) == kBauds.end()) {
      table.ErrorAt("baud", absl::StrCat("is ", baud,
                                         ", must be one of 1200, 2400, 4800, 9600, 19200, 38400, "
                                         "57600, 115200, 230400, 460800, 921600"));
    }
    const std::string parity = table.OneOf("parity", {"none", "even", "odd"});
    line.parity = parity == "even" ? 'E' : parity == "odd" ? 'O' : 'N';
    line.stop_bits = static_cast<int>(table.Int("stop_bits", 1, 2, 1));
    line.frame_gap = table.Time("frame_gap_ms", 0, 100, 0);
  }
  line.response_timeout = table.Time("response_timeout_ms", 10, 1000, 200);
  line.retries = static_cast<int>(table.Int("retries", 0, 10, 2));
  return line;
}

// 0 and 255 are for TCP: "the device itself" (MODBUS Messaging on TCP/IP V1.0b, 4.4.2). On a serial line 0 would be a broadcast, which
// nobody answers.
int ParseUnit(const TomlTable& table, const LineOptions& line) {
  const auto unit = static_cast<int>(table.Int("unit", 0, 255, 1));
  if (line.tcp() ? unit > 247 && unit < 255 : unit < 1 || unit > 247) {
    table.ErrorAt("unit",
                  absl::StrCat("is ", unit, ", must be from 1 to 247",
                               line.tcp() ? ", or 0 or 255 for a device on TCP itself" : ""));
  }
  return unit;
}

void ParseMotion(const TomlTable& table, ModbusAxisOptions& o) {
  o.continuous = table.Bool("continuous", false);
  if (o.continuous) {
    o.max = Degrees(360);
  } else {
    o.min = Degrees(table.Double("min_deg", -36000, 36000));
    o.max = Degrees(table.Double("max_deg", -36000, 36000));
    if (table.Has("min_deg") && table.Has("max_deg") && o.min >= o.max) {
      table.ErrorAt("min_deg", "must be below max_deg");
    }
  }
  o.max_velocity_dps = table.Double("max_velocity_dps", 0.001, 36000);
  o.max_acceleration_dps2 = table.Double("max_acceleration_dps2", 0.001, 1e6);
  o.settle = table.Time("settle_ms", 0, 60e3, 200);
  o.tolerance = Degrees(table.Double("tolerance_deg", 1e-6, 10, 0.05));
  o.plausibility_move = Degrees(table.Double("plausibility_move_deg", 0, 10, 0.5));
  o.poll = table.Time("poll_ms", 1, 1000, 20);
}

// What the profile makes of the rig's numbers.
void CheckScaling(const TomlTable& table, ModbusAxisOptions& o) {
  const DriveProfile& profile = o.profile;
  if (NeedsStepsPerRev(profile)) {
    o.steps_per_rev = table.Double(
        "steps_per_rev", 1, 1e9,
        profile.steps_per_rev > 0 ? std::optional(profile.steps_per_rev) : std::nullopt);
  }
  auto has_scale = [&] { return table.Has("steps_per_degree") && o.steps_per_degree > 0; };
  if (!has_scale() || (NeedsStepsPerRev(profile) && !(o.steps_per_rev >= 1))) return;
  if (o.tolerance.degrees() * o.steps_per_degree < 1) {
    table.ErrorAt("tolerance_deg", absl::StrFormat("is %g deg, finer than one step (%g deg)",
                                                   o.tolerance.degrees(), 1 / o.steps_per_degree));
  }
  if (o.plausibility_move > Degrees(0) &&
      o.plausibility_move.degrees() < 4 * o.tolerance.degrees()) {
    table.ErrorAt(
        "plausibility_move_deg",
        absl::StrFormat("is %g, must be 0 or at least 4 times the tolerance of %g deg, to "
                        "tell anything",
                        o.plausibility_move.degrees(), o.tolerance.degrees()));
  }
  if (!VelocityValue(profile, o.max_velocity_dps * o.steps_per_degree, o.steps_per_rev)) {
    table.ErrorAt("max_velocity_dps",
                  absl::StrFormat("is %g steps/s, which the drive's register cannot hold (%d to %d "
                                  "of its units)",
                                  o.max_velocity_dps * o.steps_per_degree, profile.velocity.min,
                                  profile.velocity.max));
  }
  if (!AccelerationValue(profile, o.max_acceleration_dps2 * o.steps_per_degree, o.steps_per_rev)) {
    table.ErrorAt(
        "max_acceleration_dps2",
        absl::StrFormat("is %g steps/s2, which the drive's register cannot hold (%d to %d "
                        "of its units)",
                        o.max_acceleration_dps2 * o.steps_per_degree, profile.acceleration.min,
                        profile.acceleration.max));
  }
  if (o.continuous) return;
  for (const char* key : {"min_deg", "max_deg"}) {
    if (!table.Has(key)) continue;
    const Angle limit = key == std::string_view("min_deg") ? o.min : o.max;
    const double steps = (limit - o.zero).degrees() * o.steps_per_degree * (o.reverse ? -1 : 1);
    const auto lowest =
        static_cast<double>(std::max(Lowest(profile.target), Lowest(profile.position.format)));
    const auto highest =
        static_cast<double>(std::min(Highest(profile.target), Highest(profile.position.format)));
    if (steps < lowest || steps > highest) {
      table.ErrorAt(key, absl::StrFormat("is %g steps, the drive's position goes from %g to %g",
                                         steps, lowest, highest));
    }
  }
}

LampBoard ParseBoard(const TomlTable& table, const LineOptions& line) {
  LampBoard board;
  board.unit = ParseUnit(table, line);
  if (table.Has("addresses")) {
    for (double address : table.Doubles("addresses", 0, 65535)) {
      if (address != std::floor(address)) table.ErrorAt("addresses", "must be whole numbers");
      board.addresses.push_back(static_cast<int>(address));
    }
    if (board.addresses.empty()) table.ErrorAt("addresses", "has no lamp");
    if (table.Has("first") || table.Has("count")) {
      table.ErrorAt("addresses", "stands in place of first and count");
    }
  } else {
    const int first = static_cast<int>(table.Int("first", 0, 65535, 0));
    const int count = static_cast<int>(table.Int("count", 1, kMostLamps));
    if (first + count > 65536) table.ErrorAt("count", "goes beyond address 65535");
    for (int i = 0; i < count; ++i) board.addresses.push_back(first + i);
  }
  return board;
}

}  // namespace

int ModbusLampsOptions::lamps() const {
  size_t count = 0;
  for (const LampBoard& board : boards) count += board.addresses.size();
  return static_cast<int>(count);
}

ModbusAxisOptions ParseModbusAxisOptions(const TomlTable& table) {
  ModbusAxisOptions o;
  o.line = ParseLine(table);
  o.unit = ParseUnit(table, o.line);
  o.steps_per_degree = table.Double("steps_per_degree", 0.001, 1e9);
  o.reverse = table.Bool("reverse", false);
  o.zero = Degrees(table.Double("zero_deg", -36000, 36000, 0.0));
  ParseMotion(table, o);
  const std::string selected = table.String("profile");
  if (!table.Has("profile")) {
    if (table.Has("steps_per_rev")) o.steps_per_rev = table.Double("steps_per_rev", 1, 1e9);
    return o;
  }
  absl::StatusOr<DriveProfile> profile =
      LoadDriveProfile(selected, std::filesystem::path(table.file()).parent_path().string());
  if (profile.ok()) {
    o.profile = *std::move(profile);
    CheckScaling(table, o);
  } else {
    table.ErrorAt("profile", MessageOf(profile.status()));
    if (table.Has("steps_per_rev")) o.steps_per_rev = table.Double("steps_per_rev", 1, 1e9);
  }
  return o;
}

ModbusLampsOptions ParseModbusLampsOptions(const TomlTable& table) {
  ModbusLampsOptions o;
  o.line = ParseLine(table);
  o.registers = table.OneOf("kind", {"coils", "registers"}) == "registers";
  if (o.registers) {
    o.full = static_cast<int>(table.Int("full", 1, 65535));
  } else {
    o.inverted = table.Bool("inverted", false);
  }
  o.single_writes = table.Bool("single_writes", false);
  o.settle = table.Time("settle_ms", 0, 60e3, 20);
  o.confirm = table.Time("confirm_ms", 0, 1000, 50);
  if (table.Has("board")) {
    for (const TomlTable& board : table.Tables("board"))
      o.boards.push_back(ParseBoard(board, o.line));
    if (o.boards.empty()) table.ErrorAt("board", "has no board");
  } else {
    o.boards.push_back(ParseBoard(table, o.line));
  }
  std::set<std::pair<int, int>> places;
  for (const LampBoard& board : o.boards) {
    for (int address : board.addresses) {
      if (places.emplace(board.unit, address).second) continue;
      table.ErrorAt(table.Has("board") ? "board" : "addresses",
                    absl::StrCat("two lamps are at address ", address, " of unit ", board.unit));
    }
  }
  if (o.lamps() > kMostLamps) {
    table.ErrorAt("", absl::StrCat("has ", o.lamps(), " lamps, at most are ", kMostLamps));
  }
  if (table.Has("watchdog")) {
    const TomlTable watchdog = table.Table("watchdog");
    LampWatchdog w;
    w.address = static_cast<int>(watchdog.Int("register", 0, 65535));
    w.step = watchdog.Time("step_ms", 1, 60e3);
    w.max = static_cast<int>(watchdog.Int("max", 1, 65535));
    o.watchdog = w;
  }
  return o;
}

}  // namespace lightstage
