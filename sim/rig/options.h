// What the rig file's [simulation] table says, as values. Everything that makes a rig less than ideal is off by default.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/clock.h"
#include "sim/render/rig_parts.h"

namespace lightstage::sim {

// The camera's chip. A pixel's electrons are radiance · time · sensitivity; its code is
// response(electrons · gain / full well) · full scale + black level, rounded and clipped.
struct SensorOptions {
  double sensitivity_e = 1e6;  // electrons per J/(m²·sr)
  double full_well_e = 20000;  // electrons at full scale and 0 dB
  double read_noise_e = 4;     // standard deviation
  bool photon_noise = true;    // Poisson
  // Fixed pattern, the same in every frame: standard deviations of a pixel's offset in electrons (DSNU) and of its sensitivity relative
  // to the mean (PRNU), as EMVA 1288 has them.
  double dsnu_e = 0, prnu = 0;
  double black_level =
      0;  // code without light, at the chip's full bit depth; scaled for 8-bit formats
  // Code / full scale at equally spaced exposures from 0 to full well, non-decreasing, at least 2 entries; empty: linear.
  std::vector<double> response;
  Duration
      line_time{};  // rolling shutter: every row begins and ends so much after the one above it; 0: a global shutter
};

// Between the world and the chip.
struct CameraLens {
  double vignetting =
      0;  // share of the light that is lost in the corners; growing with the square of the distance from the middle
  double blur_px = 0;  // standard deviation of a Gaussian
};

struct LampOptions {
  double intensity_w_sr = 10;  // of one lamp at level 1, straight ahead
  std::array<double, 3> color = {1, 1, 1};
  double pwm_hz =
      0;  // light is switched on and off so often, on for the level's share of each period; 0: it is steady
  // Slow drift: the intensity swings by so much either way, relative, in a period; every lamp at its own time.
  double drift = 0;
  double drift_period_s = 600;
  std::map<int, double> dim;  // lamps that give only this share of their light; 0: dead
};

struct ProjectorOptics {
  double intensity_w_sr = 10;  // on the axis, at pattern value 1; even on a wall square to the axis
  double lens_radius_m = 0;    // 0: a pinhole, sharp everywhere
  double focus_m = 0;  // from the lens to the plane in focus; 0: the plane through the origin
  double gamma = 1;    // light is pattern value ^ gamma
  double black =
      0;  // light at pattern value 0 relative to that at 1: the inverse of the contrast ratio
  double vignetting = 0;  // share of the light that is lost in the corners
};

// Faults on purpose. Counts start at 1 with the first operation of the device; 0: never.
struct Faults {
  int camera_silent_at_frame = 0;   // from this trigger on …
  int camera_silent_frames = 1;     // … that many triggers are never answered
  int camera_incomplete_every = 0;  // every Nth frame loses data
  int axis_stall_at_move =
      0;  // this move (both axes counted together) stops half-way and never reports
  int lamps_refuse_at_set = 0;       // this Set changes the light but is never confirmed
  int projector_refuse_at_show = 0;  // likewise
};

struct WorldOptions {
  std::string scene = "default";  // of the simulator, or a scene file (sim/scenes/scenes.h) …
  std::string scene_directory;    // … which is relative to this
  uint64_t seed = 1;
  int samples = 8;  // paths per pixel: each its own point in the pixel and on the lamp
  int bounces = 0;  // of light between surfaces (sim/render/paths.h); 0: direct light only
  size_t cache_bytes = size_t{512} << 20;   // for transport
  size_t paths_bytes = size_t{4096} << 20;  // a camera whose paths would take more is refused
  double ambient_w_m2_sr = 0;               // radiance of the laboratory all around, at all times
  LampOptions lamps;
  ProjectorOptics projector;
  PartOptions parts;
  CameraLens lens;
  SensorOptions sensor;
  Faults faults;
};

}  // namespace lightstage::sim
