#include "daemon/config/rig_file.h"

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "base/toml.h"
#include "daemon/config/geometry_table.h"

namespace lightstage {
namespace {

// Shorter ones would be missed by a busy machine.
constexpr Duration kLeastTimeToDark = std::chrono::milliseconds(100);

void CheckOrder(const TomlTable& table, std::string_view low_key, Angle low, Angle high) {
  if (low <= high) return;
  table.ErrorAt(low_key,
                absl::StrFormat("is %g, above the maximum %g", low.degrees(), high.degrees()));
}

LimitOptions ParseLimits(const TomlTable& table, int lamps) {
  LimitOptions limits;
  limits.azimuth_min = Degrees(table.Double("azimuth_min_deg", -36000, 36000, -360));
  limits.azimuth_max = Degrees(table.Double("azimuth_max_deg", -36000, 36000, 360));
  CheckOrder(table, "azimuth_min_deg", limits.azimuth_min, limits.azimuth_max);
  limits.tilt_min = Degrees(table.Double("tilt_min_deg", 0, 90, 0));
  limits.tilt_max = Degrees(table.Double("tilt_max_deg", 0, 90, 90));
  CheckOrder(table, "tilt_min_deg", limits.tilt_min, limits.tilt_max);
  limits.max_exposure = table.Time("max_exposure_ms", 0.001, 3.6e6, 60e3);
  limits.max_exposures_per_shot = static_cast<int>(table.Int("max_exposures_per_shot", 1, 64, 16));
  limits.max_lamps_on = static_cast<int>(table.Int("max_lamps_on", 1, kMostLamps, lamps));
  return limits;
}

std::vector<Duration> ParseExposures(const TomlTable& camera, const LimitOptions& limits) {
  constexpr std::string_view kKey = "exposures_us";
  std::vector<Duration> exposures;
  for (double us : camera.Doubles(kKey, 0.001, 3.6e9)) {
    exposures.push_back(Duration(std::llround(us * 1e3)));
  }
  if (!camera.Has(kKey)) return exposures;
  size_t most = static_cast<size_t>(limits.max_exposures_per_shot);
  if (exposures.empty() || exposures.size() > most) {
    camera.ErrorAt(kKey, absl::StrFormat("has %d elements, must have 1 to %d "
                                         "([limits] max_exposures_per_shot)",
                                         exposures.size(), most));
    return exposures;
  }
  for (size_t i = 1; i < exposures.size(); ++i) {
    if (exposures[i] > exposures[i - 1]) continue;
    camera.ErrorAt(kKey, absl::StrFormat("element %d is not above the one before it; exposures "
                                         "must ascend",
                                         i));
    return exposures;
  }
  if (exposures.back() > limits.max_exposure) {
    camera.ErrorAt(kKey, absl::StrFormat("element %d is above [limits] max_exposure_ms = %g",
                                         exposures.size() - 1, Seconds(limits.max_exposure) * 1e3));
  }
  return exposures;
}

CameraOptions ParseCamera(const TomlTable& table, const LimitOptions& limits) {
  CameraOptions options;
  std::string format = table.String("format");
  if (auto known = ParsePixelFormat(format); known.ok()) {
    options.config.format = *known;
  } else if (table.Has("format")) {
    table.ErrorAt("format", std::string(known.status().message()));
  }
  options.config.width = static_cast<int>(table.Int("width", 1, 32768));
  options.config.height = static_cast<int>(table.Int("height", 1, 32768));
  options.config.gain_db = table.Double("gain_db", -100, 100, 0);
  options.exposures = ParseExposures(table, limits);
  return options;
}

ResponseCurve ParseResponse(const TomlTable& table) {
  bool by_table = table.OneOf("response", {"linear", "table"}, "linear") == "table";
  if (!by_table) {
    if (table.Has("response_table")) {
      table.ErrorAt("response_table", "is only read if response = \"table\"");
    }
    return {};
  }
  std::vector<double> log_exposure = table.Doubles("response_table", -100, 100);
  if (!table.Has("response_table")) return {};
  auto curve = ResponseCurve::FromTable(std::move(log_exposure));
  if (curve.ok()) return *std::move(curve);
  table.ErrorAt("response_table", std::string(curve.status().message()));
  return {};
}

// `format`: the camera's, whose codes these options are about. How many of 16 bits it uses only its frames tell.
DevelopOptions ParseDevelop(const TomlTable& table, PixelFormat format) {
  DevelopOptions develop;
  develop.workers = static_cast<int>(table.Int("workers", 1, 64, DefaultWorkers()));
  develop.black_level = table.Double("black_level", 0, 65534, 0);
  develop.response = ParseResponse(table);
  develop.saturation = table.Double("saturation", 0.01, 1, 0.98);
  develop.noise_floor = table.Double("noise_floor", 0, 0.99, 0.002);
  const int codes = 1 << (8 * BytesPerSample(format));
  if (const int levels = develop.response.levels();
      levels > codes || (BytesPerSample(format) == 1 && levels > 0 && levels != codes)) {
    table.ErrorAt("response_table", absl::StrFormat("has %d entries, %s has %d codes", levels,
                                                    std::string(PixelFormatName(format)), codes));
  }
  if (develop.black_level >= develop.saturation * (codes - 1)) {
    table.ErrorAt("black_level",
                  absl::StrFormat("is %g, must be below saturation (%g of %d)", develop.black_level,
                                  develop.saturation, codes - 1));
  }
  if (develop.noise_floor >= develop.saturation) {
    table.ErrorAt("noise_floor", absl::StrFormat("is %g, must be below saturation (%g)",
                                                 develop.noise_floor, develop.saturation));
  }
  return develop;
}

StoreOptions ParseStore(const TomlTable& table) {
  StoreOptions store;
  store.compression =
      table.OneOf("compression", {"none", "rle", "zips", "zip", "piz", "dwaa"}, "piz");
  store.direct_io = table.Bool("direct_io", true);
  store.queue_shots = static_cast<int>(table.Int("queue_shots", 1, 1024, 8));
  return store;
}

EngineOptions ParseEngine(const TomlTable& table) {
  EngineOptions engine;
  engine.max_attempts = static_cast<int>(table.Int("max_attempts", 1, 100, 3));
  engine.device_timeout = table.Time("device_timeout_ms", 1, 600e3, 5e3);
  engine.heartbeat = table.Time("heartbeat_ms", 100, 600e3, 2e3);
  if (table.Has("lamp_time_to_dark_ms")) {
    engine.lamp_time_to_dark = table.Time("lamp_time_to_dark_ms", 0, 600e3);
    if (*engine.lamp_time_to_dark > Duration::zero() &&
        *engine.lamp_time_to_dark < kLeastTimeToDark)
      table.ErrorAt("lamp_time_to_dark_ms", "must be 0 (not used) or from 100 to 600000");
  }
  return engine;
}

// `options` is what the driver reads: the device's own table, or one below it.
template <class Device>
void ParseDevice(const TomlTable& table, const TomlTable& options, bool virtual_time,
                 const std::map<std::string, Driver<Device>>& drivers,
                 DeviceTable<Device>& device) {
  device.present = true;
  device.driver = table.String("driver");
  auto driver = drivers.find(device.driver);
  if (driver == drivers.end()) {
    if (table.Has("driver")) {
      std::string known;
      for (const auto& [name, unused] : drivers) {
        absl::StrAppend(&known, known.empty() ? "\"" : ", \"", name, "\"");
      }
      table.ErrorAt("driver", absl::StrCat("there is no driver \"", device.driver,
                                           "\"; known: ", known.empty() ? "none" : known));
    }
    options.Ignore();  // whose keys these are is not known
    return;
  }
  if (virtual_time && !driver->second.on_virtual_time) {
    table.ErrorAt("driver", absl::StrCat("\"", device.driver,
                                         "\" works in real time: [rig] time must be \"real\""));
  }
  device.open = driver->second.parse(options);
}

template <class Device>
void ParseOptionalDevice(const TomlTable& root, std::string_view key, bool virtual_time,
                         const std::map<std::string, Driver<Device>>& drivers,
                         DeviceTable<Device>& device) {
  if (!root.Has(key)) return;
  TomlTable table = root.Table(key);
  ParseDevice(table, table, virtual_time, drivers, device);
}

void ParseDevices(const TomlTable& root, const DriverRegistry& drivers, RigFile& file) {
  TomlTable camera = root.Table("camera", /*required=*/true);
  file.camera_options = ParseCamera(camera, file.limits);
  ParseDevice(camera, camera.Table("options"), file.virtual_time, drivers.cameras, file.camera);
  ParseOptionalDevice(root, "turntable", file.virtual_time, drivers.axes, file.turntable);
  ParseOptionalDevice(root, "tilt", file.virtual_time, drivers.axes, file.tilt);
  ParseOptionalDevice(root, "lamps", file.virtual_time, drivers.lamps, file.lamps);
  ParseOptionalDevice(root, "projector", file.virtual_time, drivers.projectors, file.projector);
  TomlTable geometry = root.Table("geometry");
  if (file.lamps.present && !geometry.Has("brace")) {
    root.ErrorAt("lamps", "needs [geometry.brace] with the place of every lamp");
  }
  if (file.projector.present && !geometry.Has("projector")) {
    root.ErrorAt("projector", "needs [geometry.projector]");
  }
}

}  // namespace

int DefaultWorkers() {
  return std::clamp(2 * static_cast<int>(std::thread::hardware_concurrency()), 2, 64);
}

absl::StatusOr<std::unique_ptr<RigFile>> ParseRigFile(std::string_view text, std::string filename,
                                                      const DriverRegistry& drivers) {
  ASSIGN_OR_RETURN(TomlDocument document, TomlDocument::Parse(text, std::move(filename)));
  const TomlTable& root = document.root();
  auto file = std::make_unique<RigFile>();
  file->text = std::string(text);

  TomlTable rig = root.Table("rig", /*required=*/true);
  file->name = rig.String("name");
  file->virtual_time = rig.OneOf("time", {"real", "fast"}, "real") == "fast";
  for (const auto& [name, parse] : drivers.tables) {
    if (root.Has(name)) parse(root.Table(name));
  }
  file->geometry = ParseGeometry(root.Table("geometry", /*required=*/true));
  file->limits =
      ParseLimits(root.Table("limits"), static_cast<int>(file->geometry.brace.lamps.size()));
  ParseDevices(root, drivers, *file);
  file->develop = ParseDevelop(root.Table("develop"), file->camera_options.config.format);
  file->store = ParseStore(root.Table("store"));
  file->engine = ParseEngine(root.Table("engine"));
  RETURN_IF_ERROR(document.Finish());
  return file;
}

}  // namespace lightstage
