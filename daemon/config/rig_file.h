// The rig file: everything that a lab says about its rig, read strictly (docs/RIGFILE.md).
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/clock.h"
#include "base/units.h"
#include "drivers/api/registry.h"
#include "optics/response.h"
#include "optics/rig_geometry.h"

namespace lightstage {

// What a shot may ask for beyond the devices' own limits.
struct LimitOptions {
  Angle azimuth_min, azimuth_max;  // plans' and manual targets for the turntable
  Angle tilt_min, tilt_max;
  Duration max_exposure{};
  int max_exposures_per_shot = 0;
  int max_lamps_on = 0;  // at once; a power supply's limit
};

// Twice the processors: while some wait for the disk others compute.
int DefaultWorkers();

struct DevelopOptions {
  int workers = 0;         // threads that develop, encode and write; [1, 64]
  double black_level = 0;  // raw code value without light, at full-scale 2^bits − 1
  ResponseCurve response;  // identity for a linear camera
  double saturation = 0;   // share of full scale from which a sample is saturated, (0, 1]
  double noise_floor = 0;  // share of full scale below which a sample is black, [0, 1)
};

struct StoreOptions {
  std::string compression;  // OpenEXR's: "none", "rle", "zips", "zip", "piz", "dwaa"
  bool direct_io = true;    // O_DIRECT where the filesystem has it
  int queue_shots = 0;      // raw shots that may wait for a worker
};

struct EngineOptions {
  int max_attempts = 0;       // per shot, the first included
  Duration device_timeout{};  // for a confirmation, beyond the time the operation itself takes
  Duration heartbeat{};       // control lease
  // 0: not used. Unset: 3 s, or what the lamps can do if that is less.
  std::optional<Duration> lamp_time_to_dark;
};

struct CameraOptions {
  CameraConfig config;
  std::vector<Duration> exposures;  // the default bracket, ascending
};

// One device table, parsed; `open` is used at most once.
template <class Device>
struct DeviceTable {
  std::string driver;
  bool present = false;
  mutable DeviceOpener<Device> open;
};

struct RigFile {
  std::string name;  // of the rig, shown to users
  std::string text;  // the file itself, stored with every run
  bool virtual_time = false;
  RigGeometry geometry;
  LimitOptions limits;
  CameraOptions camera_options;
  DevelopOptions develop;
  StoreOptions store;
  EngineOptions engine;
  DeviceTable<Camera> camera;  // always present
  DeviceTable<Axis> turntable;
  DeviceTable<Axis> tilt;
  DeviceTable<Lamps> lamps;
  DeviceTable<Projector> projector;
};

// INVALID_ARGUMENT / RIG_FILE_INVALID with file:line:column and what would be right; no device is touched.
absl::StatusOr<std::unique_ptr<RigFile>> ParseRigFile(std::string_view text, std::string filename,
                                                      const DriverRegistry& drivers);

}  // namespace lightstage
