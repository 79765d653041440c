#include "tools/render/app.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <new>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "base/env.h"
#include "base/status.h"
#include "base/version.h"
#include "client/cli/values.h"
#include "daemon/app/builtin_drivers.h"
#include "daemon/config/rig_file.h"
#include "daemon/rpc/convert.h"
#include "dataset/exr.h"
#include "optics/pattern.h"
#include "relight/png.h"
#include "sim/render/environment_light.h"
#include "sim/render/hash.h"
#include "sim/render/illuminate.h"
#include "sim/render/paths.h"
#include "sim/rig/lenses.h"
#include "sim/rig/world_scene.h"
#include "sim/scenes/scenes.h"
#include "tools/render/light_field.h"

namespace lightstage::sim {
namespace {

constexpr char kFooter[] = R"(
SCENE is the name of a scene of the simulator or a scene file (.toml); default: what the rig file's
[simulation] says.
The picture is radiance, W/(m²·sr), as it comes to the rig file's camera: without the camera's lens
and sensor, and without ambient light. MAP is a latitude-longitude
OpenEXR picture of radiance, as relight env takes it; what is below 0 in it does not shine.

Exit codes: 0 done, 1 failed, 2 the command line cannot be read)";

// Paths that are traced at a time, per pixel: the memory they take is bounded, and progress is told in between.
constexpr int kSamplesAtOnce = 16;
constexpr size_t kMostPathBytes = size_t{4} << 30;

struct Flags {
  std::string scene, rig, pattern, environment, light_field, out, png, size;
  int lamp = -1, samples = 256, bounces = kMostBounces;
  double azimuth_deg = 0, tilt_deg = 0, rotate_deg = 0;
  uint64_t seed = 1;
};

// Adds what the light gives by way of some paths, times `share`.
using AddLight = std::function<void(const Paths& paths, uint64_t seed, float share, Image* sum)>;

void Add(const Image& image, float share, Image* sum) {
  for (size_t i = 0; i < image.pixels().size(); ++i) sum->pixels()[i] += share * image.pixels()[i];
}

absl::StatusOr<AddLight> LightOf(const Flags& flags, const Scene& scene,
                                 const RigGeometry& geometry, const WorldOptions& options) {
  const Pose pose{Degrees(flags.azimuth_deg), Degrees(flags.tilt_deg)};
  // shared: the light may be copied, as functions are.
  const std::shared_ptr<RTCSceneTy> parts = RigParts(geometry, options.parts).At(pose);
  if (flags.lamp >= 0) {
    const int count = static_cast<int>(geometry.brace.lamps.size());
    if (flags.lamp >= count) {
      return Error(
          absl::StatusCode::kInvalidArgument, "LAMP_UNKNOWN",
          absl::StrFormat("lamp %d does not exist: this rig has %d lamps", flags.lamp, count));
    }
    auto light_of = [&, pose](uint64_t seed) {
      return LampLight(geometry.brace, flags.lamp, pose.azimuth, options.lamps.intensity_w_sr,
                       seed);
    };
    RETURN_IF_ERROR(
        scene.CheckOutside(Vec3f(light_of(0).center), absl::StrCat("lamp ", flags.lamp)));
    auto dim = options.lamps.dim.find(flags.lamp);
    const double strength = dim == options.lamps.dim.end() ? 1 : dim->second;
    return
        [&, light_of, parts, strength](const Paths& paths, uint64_t seed, float share, Image* sum) {
          Image image = Illuminate(scene, paths, light_of(seed), parts.get());
          for (size_t i = 0; i < image.pixels().size(); ++i) {
            image.pixels()[i] *= static_cast<float>(strength * options.lamps.color[i % 3]);
          }
          Add(image, share, sum);
        };
  }
  if (!flags.pattern.empty()) {
    if (!geometry.projector.present) {
      return Error(absl::StatusCode::kInvalidArgument, "PROJECTOR_MISSING",
                   "the rig file has no projector");
    }
    ASSIGN_OR_RETURN(v1::Pattern message, client::ParsePattern(flags.pattern));
    ASSIGN_OR_RETURN(Pattern pattern, rpc::FromMessage(message));
    RETURN_IF_ERROR(Validate(pattern));
    Image raster = Emitted(Rasterize(pattern, geometry.projector.width, geometry.projector.height),
                           options.projector);
    auto light_of = [&, pose](uint64_t seed) {
      return ProjectorLight(geometry.projector, LensOf(options.projector, geometry.projector), pose,
                            options.projector.intensity_w_sr, seed);
    };
    RETURN_IF_ERROR(scene.CheckOutside(Vec3f(light_of(0).position), "the projector"));
    return [&, light_of, parts, raster = std::move(raster)](const Paths& paths, uint64_t seed,
                                                            float share, Image* sum) {
      Illuminate(scene, paths, light_of(seed), parts.get()).Add(raster, share, sum);
    };
  }
  if (!flags.light_field.empty()) {
    ASSIGN_OR_RETURN(IncidentLightField field, ReadLightField(flags.light_field));
    auto light = std::make_shared<IncidentLightField>(std::move(field));
    return [&scene, light](const Paths& paths, uint64_t, float share, Image* sum) {
      Add(Illuminate(scene, paths, *light), share, sum);
    };
  }
  ASSIGN_OR_RETURN(const EnvironmentMap map, ReadEnvironmentMap(flags.environment));
  auto light = std::make_shared<EnvironmentLight>(map, Degrees(flags.rotate_deg));
  if (light->IsBlack()) {
    return Error(absl::StatusCode::kInvalidArgument, "ENVIRONMENT_BLACK",
                 absl::StrCat(flags.environment, ": is black: no pixel is above 0"));
  }
  return [&scene, light](const Paths& paths, uint64_t, float share, Image* sum) {
    Add(Illuminate(scene, paths, *light), share, sum);
  };
}

absl::Status Usage(const std::string& message) {
  return Error(absl::StatusCode::kInvalidArgument, "USAGE", message);
}

absl::Status ParseSize(const std::string& text, int* width, int* height) {
  const std::vector<std::string> parts = absl::StrSplit(text, 'x');
  auto number = [](const std::string& digits, int* out) {
    return !digits.empty() && digits.size() <= 5 &&
           std::all_of(digits.begin(), digits.end(), absl::ascii_isdigit) &&
           absl::SimpleAtoi(digits, out) && *out >= 1 && *out <= 16384;
  };
  if (parts.size() == 2 && number(parts[0], width) && number(parts[1], height))
    return absl::OkStatus();
  return Usage(absl::StrCat("'", text, "' is no size: give e.g. 640x480, up to 16384"));
}

bool SamePlace(const std::string& a, const std::string& b) {
  std::error_code failed;  // then it is no place, which whoever opens it says
  const std::filesystem::path first = std::filesystem::weakly_canonical(a, failed);
  if (failed) return false;
  const std::filesystem::path second = std::filesystem::weakly_canonical(b, failed);
  return !failed && first == second;
}

// That a picture can be written there, as far as can be seen.
absl::Status CheckOutput(const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code failed;
  const fs::file_status there = fs::status(file, failed);
  if (there.type() == fs::file_type::none) {
    return Error(absl::StatusCode::kInvalidArgument, "FILE",
                 absl::StrCat(file, ": ", failed.message()));
  }
  if (fs::exists(there) && !fs::is_regular_file(there)) {
    return Usage(
        absl::StrCat(file, " is ", fs::is_directory(there) ? "a folder" : "no regular file"));
  }
  const fs::path folder = fs::path(file).parent_path();
  if (folder.empty() || fs::is_directory(folder, failed)) return absl::OkStatus();
  return Error(absl::StatusCode::kNotFound, "FOLDER",
               absl::StrCat(file, ": there is no folder ", folder.string()));
}

// What the options' own checks let through.
absl::Status CheckFlags(const Flags& flags) {
  for (const auto& [name, value] :
       {std::pair("--azimuth", flags.azimuth_deg), std::pair("--tilt", flags.tilt_deg),
        std::pair("--rotate", flags.rotate_deg)}) {
    if (!std::isfinite(value)) return Usage(absl::StrCat(name, " must be a number"));
  }
  if (flags.rotate_deg != 0 && flags.environment.empty())
    return Usage("--rotate turns the --environment; there is none");
  if (flags.out.empty()) return Usage("--out is empty");
  // Before hours are spent.
  RETURN_IF_ERROR(CheckOutput(flags.out));
  if (!flags.png.empty()) {
    RETURN_IF_ERROR(CheckOutput(flags.png));
    if (SamePlace(flags.png, flags.out)) return Usage("--out and --png are the same file");
  }
  return absl::OkStatus();
}

// The files that the command line and the rig file name.
std::vector<std::string> InputsOf(const Flags& flags, const WorldOptions& options) {
  namespace fs = std::filesystem;
  std::vector<std::string> inputs = {flags.rig,
                                     (fs::path(options.scene_directory) / options.scene).string()};
  if (!flags.environment.empty()) inputs.push_back(flags.environment);
  std::error_code failed;  // then there is nothing to replace, which whoever reads it says
  if (!flags.light_field.empty()) {
    for (fs::directory_iterator it(flags.light_field, failed), end; it != end; it.increment(failed))
      inputs.push_back(it->path().string());
  }
  return inputs;
}

absl::Status CheckReplacesNone(const Flags& flags, const std::vector<std::string>& inputs) {
  for (const auto& [name, file] : {std::pair("--out", flags.out), std::pair("--png", flags.png)}) {
    for (const std::string& input : inputs) {
      if (file.empty() || !SamePlace(file, input)) continue;
      return Usage(absl::StrCat(name, " would replace ", input, ", which is read"));
    }
  }
  return absl::OkStatus();
}

absl::Status Render(const Flags& flags, std::ostream& out, std::ostream& err, bool terminal) {
  RETURN_IF_ERROR(CheckFlags(flags));
  DriverRegistry drivers;
  std::shared_ptr<Simulation> simulation = RegisterBuiltinDrivers(drivers);
  ASSIGN_OR_RETURN(std::string text, PosixEnv().ReadInput(flags.rig));
  ASSIGN_OR_RETURN(std::unique_ptr<RigFile> rig, ParseRigFile(text, flags.rig, drivers));
  WorldOptions options = simulation->options();
  if (!flags.scene.empty()) {
    options.scene = flags.scene;
    options.scene_directory = "";
  }
  RETURN_IF_ERROR(CheckReplacesNone(flags, InputsOf(flags, options)));
  int width = rig->camera_options.config.width, height = rig->camera_options.config.height;
  if (!flags.size.empty()) RETURN_IF_ERROR(ParseSize(flags.size, &width, &height));

  ASSIGN_OR_RETURN(Scene scene, MakeWorldScene(options, rig->geometry));
  ASSIGN_OR_RETURN(AddLight add, LightOf(flags, scene, rig->geometry, options));

  const PathOptions path_options{.samples = 1, .bounces = flags.bounces, .seed = flags.seed};
  const size_t bytes = EstimatePathBytes(scene, rig->geometry.camera, width, height, path_options);
  if (bytes > kMostPathBytes) {
    return Error(
        absl::StatusCode::kResourceExhausted, "MEMORY",
        absl::StrFormat("a picture of %d×%d takes about %.1f GB for its paths, at most %.1f GB "
                        "are used: make it or --bounces smaller",
                        width, height, bytes / 1e9, kMostPathBytes / 1e9));
  }
  const int at_once = static_cast<int>(
      std::clamp<size_t>(kMostPathBytes / std::max<size_t>(bytes, 1), 1, kSamplesAtOnce));

  Image sum(width, height, 3);
  const auto start = std::chrono::steady_clock::now();
  auto told = start;
  for (int done = 0; done < flags.samples;) {
    const int samples = std::min(at_once, flags.samples - done);
    const uint64_t seed = Fold(flags.seed, static_cast<uint64_t>(done));
    const Paths paths(scene, rig->geometry.camera, width, height,
                      {.samples = samples, .bounces = flags.bounces, .seed = seed});
    add(paths, seed, static_cast<float>(samples) / static_cast<float>(flags.samples), &sum);
    done += samples;
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::duration<double> taken = now - start;
    if (now - told < (terminal ? std::chrono::milliseconds(100) : std::chrono::milliseconds(5000)))
      continue;
    told = now;
    err << (terminal ? "\r" : "")
        << absl::StrFormat("%3.0f%%  %d/%d samples, %.0f s left", 100.0 * done / flags.samples,
                           done, flags.samples, taken.count() * (flags.samples - done) / done)
        << (terminal ? "\x1b[K" : "\n") << std::flush;
  }
  if (terminal) err << "\r\x1b[K" << std::flush;
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;

  RETURN_IF_ERROR(WriteExr(flags.out, sum, ExrPixelType::kFloat));
  if (!flags.png.empty())
    RETURN_IF_ERROR(relight::WritePng(flags.png, sum, relight::AutoExposure(sum)));
  out << absl::StrFormat("%s: %d×%d, %d samples, %.1f s\n", flags.out, width, height, flags.samples,
                         taken.count());
  return absl::OkStatus();
}

}  // namespace

int RunApp(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err,
           bool err_is_terminal) {
  CLI::App app("Renders the simulated world: ground truth for captured and relit pictures",
               "lightstage-render");
  Flags flags;
  std::string scenes = "Scenes:\n";
  for (const ShippedScene& scene : ShippedScenes()) {
    absl::StrAppendFormat(&scenes, "  %-12s %s\n", scene.name, scene.what);
  }
  app.footer(scenes + kFooter);
  app.set_version_flag("--version", std::string("lightstage-render ") + kVersion);
  app.add_option("SCENE", flags.scene, "Which scene")->check([](const std::string& scene) {
    return IsSceneName(scene) ? std::string()
                              : absl::StrCat("there is no scene '", scene, "'; --help lists them");
  });
  app.add_option("--rig", flags.rig, "Rig file (TOML): geometry, camera, lights")->required();
  const CLI::Validator not_empty(
      [](const std::string& text) { return std::string(text.empty() ? "is empty" : ""); }, "");
  auto* light = app.add_option_group("light", "What shines; one of them");
  light->add_option("--lamp", flags.lamp, "This lamp at level 1")->check(CLI::Range(0, 65535));
  light
      ->add_option("--pattern", flags.pattern,
                   "The projector, e.g. full or square,grid=16,column=3,row=8")
      ->check(not_empty);
  light->add_option("--environment", flags.environment, "An environment map (OpenEXR)")
      ->check(not_empty);
  light
      ->add_option("--incident-light-field", flags.light_field,
                   "A folder of environment maps on a grid (tools/render/light_field.h)")
      ->check(not_empty);
  light->require_option(1);
  app.add_option("--azimuth", flags.azimuth_deg, "Turntable, degrees")
      ->check(CLI::Range(-360.0, 360.0));
  app.add_option("--tilt", flags.tilt_deg, "Projector's gantry, degrees")
      ->check(CLI::Range(0.0, 90.0));
  app.add_option("--rotate", flags.rotate_deg,
                 "Turn the environment map about the vertical, degrees")
      ->check(CLI::Range(-360.0, 360.0));
  app.add_option("--spp", flags.samples, "Paths per pixel")
      ->check(CLI::Range(1, 1 << 20))
      ->capture_default_str();
  app.add_option("--bounces", flags.bounces, "Between surfaces; 0: direct light only")
      ->check(CLI::Range(0, kMostBounces))
      ->capture_default_str();
  app.add_option("--seed", flags.seed, "Of the noise")
      ->check(CLI::Range(uint64_t{0}, uint64_t{INT64_MAX}))
      ->capture_default_str();
  app.add_option("--size", flags.size, "WIDTHxHEIGHT; default: the rig file's camera");
  app.add_option("--out", flags.out, "The picture (OpenEXR, linear float)")->required();
  app.add_option("--png", flags.png, "The same for looking at, exposed automatically");
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& e) {
    return app.exit(e, out, err) == 0 ? 0 : 2;
  }
  absl::Status rendered;
  try {
    rendered = Render(flags, out, err, err_is_terminal);
  } catch (const std::bad_alloc&) {
    rendered = Error(absl::StatusCode::kResourceExhausted, "MEMORY",
                     "there is not enough memory: make the picture or --bounces smaller");
  } catch (const std::system_error& e) {  // a thread that cannot be started
    rendered = Error(absl::StatusCode::kResourceExhausted, "SYSTEM",
                     absl::StrCat("the system does not give what is needed: ", e.what()));
  }
  if (rendered.ok()) return 0;
  err << "lightstage-render: " << MessageOf(rendered) << "\n";
  return ErrorReason(rendered) == "USAGE" ? 2 : 1;
}

}  // namespace lightstage::sim
