#include "sim/rig/drivers.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "base/mutex.h"
#include "base/status.h"
#include "sim/render/paths.h"
#include "sim/rig/sim_axis.h"
#include "sim/rig/sim_camera.h"
#include "sim/rig/sim_lamps.h"
#include "sim/rig/sim_projector.h"
#include "sim/rig/world_scene.h"
#include "sim/scenes/scenes.h"

namespace lightstage::sim {
namespace {

// Code / full scale at equally spaced exposures, or nothing if the camera is linear.
std::vector<double> ParseResponse(const TomlTable& table) {
  const std::string kind = table.OneOf("response", {"linear", "gamma", "table"}, "linear");
  std::vector<double> response;
  if (kind == "gamma") {
    constexpr int kSteps = 4096;  // the curve is steep at 0
    const double gamma = table.Double("response_gamma", 0.1, 10, 2.2);
    for (int i = 0; i <= kSteps; ++i) {
      response.push_back(std::pow(static_cast<double>(i) / kSteps, 1 / gamma));
    }
  } else if (kind == "table") {
    response = table.Doubles("response_table", 0, 1);
    if (response.size() < 2) table.ErrorAt("response_table", "must have at least 2 elements");
    for (size_t i = 1; i < response.size(); ++i) {
      if (response[i] >= response[i - 1]) continue;
      table.ErrorAt("response_table", absl::StrCat("element ", i, " is below the one before it"));
      break;
    }
  }
  return response;
}

Faults ParseFaults(const TomlTable& table) {
  constexpr int kMany = 1000000000;
  auto count = [&](const char* key, int fallback) {
    return static_cast<int>(table.Int(key, fallback, kMany, fallback));
  };
  Faults faults;
  faults.camera_silent_at_frame = count("camera_silent_at_frame", 0);
  faults.camera_silent_frames = count("camera_silent_frames", 1);
  faults.camera_incomplete_every = count("camera_incomplete_every", 0);
  faults.axis_stall_at_move = count("axis_stall_at_move", 0);
  faults.lamps_refuse_at_set = count("lamps_refuse_at_set", 0);
  faults.projector_refuse_at_show = count("projector_refuse_at_show", 0);
  return faults;
}

SensorOptions ParseSensor(const TomlTable& table) {
  SensorOptions s;
  s.sensitivity_e = table.Double("sensitivity_e", 1e-6, 1e12, s.sensitivity_e);
  s.full_well_e = table.Double("full_well_e", 1, 1e9, s.full_well_e);
  s.read_noise_e = table.Double("read_noise_e", 0, 1e6, s.read_noise_e);
  s.photon_noise = table.Bool("photon_noise", s.photon_noise);
  s.dsnu_e = table.Double("dsnu_e", 0, 1e6, 0);
  s.prnu = table.Double("prnu", 0, 1, 0);
  s.black_level = table.Double("black_level", 0, 65535, s.black_level);
  s.response = ParseResponse(table);
  s.line_time = table.Time("line_time_us", 0, 1e5, 0);
  return s;
}

// 0, which says that there is none, or from lo to hi.
double ZeroOr(const TomlTable& table, const char* key, double lo, double hi) {
  const double value = table.Double(key, 0, hi, 0);
  if (value > 0 && value < lo) {
    table.ErrorAt(key, absl::StrCat("must be 0, or from ", lo, " to ", hi));
  }
  return value;
}

LampOptions ParseLampOptions(const TomlTable& table) {
  LampOptions o;
  o.intensity_w_sr = table.Double("intensity_w_sr", 0, 1e6, o.intensity_w_sr);
  const std::vector<double> color = table.Doubles("color", 0, 10, 3, std::vector<double>{1, 1, 1});
  if (color.size() == 3) std::copy(color.begin(), color.end(), o.color.begin());
  o.pwm_hz = table.Double("pwm_hz", 0, 1e6, 0);
  o.drift = table.Double("drift", 0, 0.5, 0);
  o.drift_period_s = table.Double("drift_period_s", 1, 1e6, o.drift_period_s);
  for (const TomlTable& dim : table.Tables("dim")) {
    const int lamp = static_cast<int>(dim.Int("lamp", 0, 1023));
    if (!o.dim.emplace(lamp, dim.Double("share", 0, 1, 0)).second) {
      dim.ErrorAt("lamp", absl::StrCat("lamp ", lamp, " is dim already"));
    }
  }
  return o;
}

ProjectorOptics ParseProjectorOptics(const TomlTable& table) {
  ProjectorOptics o;
  o.intensity_w_sr = table.Double("intensity_w_sr", 0, 1e6, o.intensity_w_sr);
  o.lens_radius_m = table.Double("lens_radius_m", 0, 1, 0);
  o.focus_m = ZeroOr(table, "focus_m", 0.01, 100);
  o.gamma = table.Double("gamma", 0.1, 10, 1);
  const double contrast = ZeroOr(table, "contrast", 2, 1e9);
  o.black = contrast > 0 ? 1 / contrast : 0;
  o.vignetting = table.Double("vignetting", 0, 1, 0);
  return o;
}

WorldOptions ParseSimulation(const TomlTable& table) {
  WorldOptions o;
  o.scene = table.String("scene", o.scene);
  if (!IsSceneName(o.scene)) {
    table.ErrorAt("scene", absl::StrCat("'", o.scene, "' is unknown; there are ",
                                        absl::StrJoin(ShippedScenes(), ", ",
                                                      [](std::string* out, const ShippedScene& s) {
                                                        out->append(s.name);
                                                      }),
                                        ", and scene files that end with .toml"));
  }
  o.scene_directory = std::filesystem::path(table.file()).parent_path().string();
  // Read here to say what is wrong with it before anything starts; the world reads it for itself.
  if (o.scene.ends_with(".toml")) {
    absl::Status sound = LoadScene(o.scene, o.scene_directory).status();
    if (!sound.ok()) table.ErrorAt("scene", MessageOf(sound));
  }
  o.seed = static_cast<uint64_t>(table.Int("seed", 0, INT64_MAX, static_cast<int64_t>(o.seed)));
  o.samples = static_cast<int>(table.Int("samples", 1, 256, o.samples));
  o.bounces = static_cast<int>(table.Int("bounces", 0, kMostBounces, o.bounces));
  o.cache_bytes = static_cast<size_t>(table.Int("cache_mb", 0, 1 << 20, 512)) << 20;
  o.paths_bytes = static_cast<size_t>(table.Int("paths_mb", 1, 1 << 20, 4096)) << 20;
  o.ambient_w_m2_sr = table.Double("ambient_w_m2_sr", 0, 1e6, 0);
  o.lamps = ParseLampOptions(table.Table("lamps"));
  o.projector = ParseProjectorOptics(table.Table("projector"));
  const TomlTable parts = table.Table("parts");
  o.parts.camera_body = ZeroOr(parts, "camera_body_m", 1e-4, 10);
  o.parts.brace_bar = ZeroOr(parts, "brace_bar_m", 1e-4, 10);
  o.parts.projector_body = ZeroOr(parts, "projector_body_m", 1e-4, 10);
  o.parts.gantry_bar = ZeroOr(parts, "gantry_bar_m", 1e-4, 10);
  const TomlTable lens = table.Table("lens");
  o.lens.vignetting = lens.Double("vignetting", 0, 1, 0);
  o.lens.blur_px = ZeroOr(lens, "blur_px", 0.05, 20);
  o.sensor = ParseSensor(table.Table("sensor"));
  o.faults = ParseFaults(table.Table("faults"));
  return o;
}

class SharedSimulation final : public Simulation {
 public:
  void SetOptions(WorldOptions options) {
    MutexLock lock(&mutex_);
    options_ = std::make_shared<const WorldOptions>(std::move(options));
    was_read_ = true;
  }

  WorldOptions options() const override {
    MutexLock lock(&mutex_);
    return *options_;
  }

  absl::Status CheckScene(const RigGeometry& geometry) const override {
    {
      MutexLock lock(&mutex_);
      if (!was_read_) return absl::OkStatus();
    }
    return MakeWorldScene(options(), geometry).status();
  }

  absl::StatusOr<std::shared_ptr<World>> OpenWorld(const RigGeometry& geometry,
                                                   Clock& clock) override {
    MutexLock lock(&mutex_);
    std::shared_ptr<World> world = world_.lock();
    if (world != nullptr && &world->clock() == &clock && made_of_ == options_) return world;
    ASSIGN_OR_RETURN(world, World::Create(*options_, geometry, clock));
    world_ = world;
    made_of_ = options_;
    return world;
  }

 private:
  mutable Mutex mutex_;
  // shared: compared by identity, so that a rig file read anew gets a world of its own.
  std::shared_ptr<const WorldOptions> options_ ABSL_GUARDED_BY(mutex_) =
      std::make_shared<const WorldOptions>();
  bool was_read_ ABSL_GUARDED_BY(mutex_) = false;
  std::shared_ptr<const WorldOptions> made_of_ ABSL_GUARDED_BY(mutex_);
  std::weak_ptr<World> world_ ABSL_GUARDED_BY(mutex_);
};

using SimulationPtr = std::shared_ptr<SharedSimulation>;

absl::Status Lacks(const DeviceContext& context, const char* what) {
  return Error(absl::StatusCode::kFailedPrecondition, "GEOMETRY",
               absl::StrCat(context.name, ": the rig's geometry has no ", what),
               {{"device", context.name}});
}

DeviceOpener<Camera> ParseCamera(const SimulationPtr& simulation, const TomlTable& table) {
  SimCameraOptions o;
  o.width = static_cast<int>(table.Int("sensor_width", 2, 16384, 640));
  o.height = static_cast<int>(table.Int("sensor_height", 2, 16384, 480));
  if (o.width % 2 != 0) table.ErrorAt("sensor_width", "must be even");
  if (o.height % 2 != 0) table.ErrorAt("sensor_height", "must be even");
  o.bits = static_cast<int>(table.Int("bits", 9, 16, 12));
  o.readout = table.Time("readout_ms", 0, 60e3, 5);
  o.min_exposure = table.Time("min_exposure_us", 1, 1e6, 10);
  o.max_exposure = table.Time("max_exposure_ms", 1, 30e3, 10e3);
  if (o.min_exposure > o.max_exposure) {
    table.ErrorAt("min_exposure_us", "is above max_exposure_ms");
  }
  o.max_gain_db = table.Double("max_gain_db", 0, 60, 24);
  return [simulation, o](const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Camera>> {
    ASSIGN_OR_RETURN(auto world, simulation->OpenWorld(*context.geometry, *context.clock));
    if (absl::Status fits = world->CheckFilm({o.width, o.height}); !fits.ok()) {
      return Annotate(fits, context.name);
    }
    if (const int full_scale = (1 << o.bits) - 1; world->sensor().black_level >= full_scale) {
      return Error(absl::StatusCode::kInvalidArgument, "BLACK_LEVEL",
                   absl::StrCat(context.name, ": [simulation.sensor] black_level is ",
                                world->sensor().black_level, ", must be below ", full_scale,
                                ", the full scale of ", o.bits, " bits"),
                   {{"device", context.name}});
    }
    return std::make_unique<SimCamera>(context.name, o, std::move(world));
  };
}

DeviceOpener<Axis> ParseAxis(const SimulationPtr& simulation, const TomlTable& table) {
  SimAxisOptions o;
  o.role = AxisRoleOf(table);
  const bool tilts = o.role == AxisRole::kTilt;
  o.continuous = !tilts;
  if (tilts) {
    o.min = Degrees(table.Double("min_deg", 0, 89, 0));
    o.max = Degrees(table.Double("max_deg", 1, 90, 90));
    if (o.min >= o.max) table.ErrorAt("min_deg", "must be below max_deg");
  } else {
    o.max = Degrees(360);
  }
  o.max_velocity_dps = table.Double("max_velocity_dps", 0.01, 3600, tilts ? 20 : 40);
  o.mechanics.max_acceleration_dps2 =
      table.Double("max_acceleration_dps2", 0.01, 36000, tilts ? 40 : 80);
  o.mechanics.settle = table.Time("settle_ms", 0, 60e3, tilts ? 200 : 150);
  o.mechanics.shake_deg = table.Double("shake_deg", 0, 5, 0.05);
  return [simulation, o](const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Axis>> {
    ASSIGN_OR_RETURN(auto world, simulation->OpenWorld(*context.geometry, *context.clock));
    return std::make_unique<SimAxis>(context.name, o, std::move(world));
  };
}

DeviceOpener<Lamps> ParseLamps(const SimulationPtr& simulation, const TomlTable& table) {
  SimLampsOptions o;
  o.steps = static_cast<int>(table.Int("steps", 0, 65535, 255));
  o.settle = table.Time("settle_ms", 0, 60e3, 2);
  o.rise = table.Time("rise_ms", 0, 60e3, Seconds(o.settle) * 1e3);
  o.fall = table.Time("fall_ms", 0, 60e3, Seconds(o.settle) * 1e3);
  o.max_time_to_dark = table.Time("max_time_to_dark_ms", 0, 3.6e6, 60e3);
  return [simulation, o](const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Lamps>> {
    if (context.geometry->brace.lamps.empty()) return Lacks(context, "lamps");
    ASSIGN_OR_RETURN(auto world, simulation->OpenWorld(*context.geometry, *context.clock));
    return std::make_unique<SimLamps>(context.name, o, std::move(world));
  };
}

DeviceOpener<Projector> ParseProjector(const SimulationPtr& simulation, const TomlTable& table) {
  SimProjectorOptions o;
  o.settle = table.Time("settle_ms", 0, 60e3, 20);
  o.latency = table.Time("latency_ms", 0, 60e3, 0);
  return
      [simulation, o](const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Projector>> {
        RETURN_IF_ERROR(CheckProjector(context));
        ASSIGN_OR_RETURN(auto world, simulation->OpenWorld(*context.geometry, *context.clock));
        return std::make_unique<SimProjector>(context.name, o, std::move(world));
      };
}

// A driver whose tables are read by `parse`. The registry is const when it is used, so what the tables have in common sits behind
// a shared pointer that every closure holds.
template <class Device>
Driver<Device> MakeDriver(const SimulationPtr& simulation,
                          DeviceOpener<Device> (*parse)(const SimulationPtr&, const TomlTable&)) {
  Driver<Device> driver;
  driver.parse = [simulation, parse](const TomlTable& table) { return parse(simulation, table); };
  driver.on_virtual_time = true;
  return driver;
}

}  // namespace

AxisRole AxisRoleOf(const TomlTable& table) {
  const std::string& path = table.path();
  if (path.ends_with("tilt")) return AxisRole::kTilt;
  if (!path.ends_with("turntable")) {
    table.ErrorAt("", "the simulated axes are [turntable] and [tilt]");
  }
  return AxisRole::kTurntable;
}

absl::Status CheckLampCount(const DeviceContext& context, int lamps) {
  const size_t there = context.geometry->brace.lamps.size();
  if (there == 0) return Lacks(context, "lamps");
  if (there == static_cast<size_t>(lamps)) return absl::OkStatus();
  return Error(absl::StatusCode::kFailedPrecondition, "GEOMETRY",
               absl::StrCat(context.name, ": has ", lamps,
                            " lamps, must have as many as the rig's brace: ", there),
               {{"device", context.name}});
}

absl::Status CheckProjector(const DeviceContext& context) {
  return context.geometry->projector.present ? absl::OkStatus() : Lacks(context, "projector");
}

std::shared_ptr<Simulation> RegisterSimulatedDrivers(DriverRegistry& registry) {
  auto simulation = std::make_shared<SharedSimulation>();
  registry.tables["simulation"] = [simulation](const TomlTable& table) {
    simulation->SetOptions(ParseSimulation(table));
  };
  registry.cameras["sim"] = MakeDriver<Camera>(simulation, &ParseCamera);
  registry.axes["sim"] = MakeDriver<Axis>(simulation, &ParseAxis);
  registry.lamps["sim"] = MakeDriver<Lamps>(simulation, &ParseLamps);
  registry.projectors["sim"] = MakeDriver<Projector>(simulation, &ParseProjector);
  return simulation;
}

}  // namespace lightstage::sim
