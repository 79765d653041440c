#include "drivers/canopen/options.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/env.h"
#include "base/status.h"
#include "drivers/canopen/messages.h"

namespace lightstage::canopen {
namespace {

// Ids that no node of the lab is likely to have. Two, because a lamps node that is watched by time to dark must not hear the
// heartbeat that the axes live by.
constexpr int kAxisHeartbeatId = 127, kLampsHeartbeatId = 126;

constexpr int64_t kAny = UINT32_MAX;

NodeOptions ParseNode(const TomlTable& table, int heartbeat_id) {
  NodeOptions o;
  o.interface = table.String("interface");
  // The kernel's limit is 15 bytes.
  if (table.Has("interface") && (o.interface.empty() || o.interface.size() > 15 ||
                                 o.interface.find_first_of("/ \t:") != std::string::npos)) {
    table.ErrorAt("interface", "must be a CAN interface of the kernel, e.g. \"can0\"");
  }
  o.node = static_cast<int>(table.Int("node", 1, kMaxNode));
  auto identity = [&](const char* key) -> std::optional<uint32_t> {
    if (!table.Has(key)) return std::nullopt;
    return static_cast<uint32_t>(table.Int(key, 0, kAny));
  };
  o.vendor = identity("vendor_id");
  o.product = identity("product_code");
  o.serial = identity("serial_number");
  o.answer_time = table.Time("answer_ms", 5, 1000, 200.0);
  o.heartbeat = table.Time("heartbeat_ms", 30, 30000, 500.0);
  o.heartbeat_id = static_cast<int>(table.Int("heartbeat_id", 1, kMaxNode, heartbeat_id));
  if (o.heartbeat_id == o.node && o.node != 0) {
    table.ErrorAt(
        table.Has("heartbeat_id") ? "heartbeat_id" : "node",
        absl::StrCat("node ", o.node, " can not be the id of this computer's heartbeat as well"));
  }
  if (const std::string file = table.String("eds", ""); !file.empty()) {
    const std::filesystem::path path =
        std::filesystem::path(table.file()).parent_path() / std::filesystem::path(file);
    absl::StatusOr<std::string> text = ReadNamedFile(path.string(), PosixEnv());
    absl::StatusOr<Eds> eds =
        text.ok() ? Eds::Parse(*text, file, o.node) : absl::StatusOr<Eds>(text.status());
    if (eds.ok()) {
      o.eds = std::make_shared<const Eds>(*std::move(eds));
    } else {
      table.ErrorAt("eds", MessageOf(eds.status()));
    }
  }
  return o;
}

}  // namespace

AxisOptions ParseAxisOptions(const TomlTable& table) {
  AxisOptions o;
  o.node = ParseNode(table, kAxisHeartbeatId);
  o.continuous = table.Bool("continuous", false);
  if (o.continuous) {
    if (table.Has("min_deg") || table.Has("max_deg")) {
      table.ErrorAt(table.Has("min_deg") ? "min_deg" : "max_deg",
                    "a continuous axis has no limits; leave this out");
      table.Double("min_deg", -36000, 36000, 0.0);
      table.Double("max_deg", -36000, 36000, 0.0);
    }
    o.min = Degrees(0);
    o.max = Degrees(360);
  } else {
    o.min = Degrees(table.Double("min_deg", -36000, 36000));
    o.max = Degrees(table.Double("max_deg", -36000, 36000));
    if (table.Has("min_deg") && table.Has("max_deg") && o.min >= o.max) {
      table.ErrorAt("min_deg", "must be below max_deg");
    }
  }
  o.units_per_turn = table.Double("units_per_turn", -1e9, 1e9);
  if (table.Has("units_per_turn") && std::abs(o.units_per_turn) < 1) {
    table.ErrorAt("units_per_turn", "must be at least 1 either way");
  }
  const double units = std::clamp(std::abs(o.units_per_turn), 1.0, 1e9);
  o.zero = Degrees(table.Double("zero_deg", -36000, 36000, 0.0));
  o.velocity_units = table.Double("velocity_units_per_turn_s", 1e-3, 1e9, units);
  o.acceleration_units = table.Double("acceleration_units_per_turn_s2", 1e-3, 1e9, units);
  o.max_velocity_dps = table.Double("max_velocity_dps", 0.001, 36000);
  o.max_acceleration_dps2 = table.Double("max_acceleration_dps2", 0.001, 1e6);
  o.settle = table.Time("settle_ms", 0, 60e3, 0.0);
  o.tolerance = Degrees(table.Double("tolerance_deg", 0, 10, 0.01));
  o.standstill_dps = table.Double("standstill_dps", 0, 10, 0.05);
  o.homing_method = static_cast<int>(table.Int("homing_method", -128, 127));
  if (table.Has("homing_method") && o.homing_method == 0) {
    table.ErrorAt("homing_method",
                  "0 is no homing; 37 (or 35) takes the present position, see the drive's manual");
  }
  o.homing_velocity_dps = table.Double("homing_velocity_dps", 0.001, 36000);
  o.homing_slow_velocity_dps = table.Double("homing_slow_velocity_dps", 0.001, 36000,
                                            std::clamp(o.homing_velocity_dps / 5, 0.001, 36000.0));
  o.stop_by_quick_stop = table.OneOf("stop", {"halt", "quick-stop"}, "halt") == "quick-stop";
  o.use_pdo = table.Bool("pdo", true);
  o.poll = table.Time("poll_ms", 1, 1000, 10.0);
  o.enable_time = table.Time("enable_ms", 10, 10000, 1000.0);
  o.setpoint_time = table.Time("setpoint_ms", 5, 2000, 200.0);
  return o;
}

LampsOptions ParseLampsOptions(const TomlTable& table) {
  LampsOptions o;
  o.node = ParseNode(table, kLampsHeartbeatId);
  o.output = table.OneOf("output", {"digital", "analogue"}) == "analogue" ? LampOutput::kAnalogue
                                                                          : LampOutput::kDigital;
  // CiA 401 has 254 groups of 8 digital outputs, and 254 analogue ones.
  o.first_output = static_cast<int>(table.Int("first_output", 0, 2031, 0));
  o.full_scale = 1;
  if (o.output == LampOutput::kAnalogue) {
    o.full_scale = static_cast<int>(table.Int("full_scale", 1, 32767, 32767));
  }
  o.settle = table.Time("settle_ms", 0, 60e3, 20.0);
  return o;
}

}  // namespace lightstage::canopen
