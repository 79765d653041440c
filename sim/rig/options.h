// What the rig file's [simulation] table says, as values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace lightstage::sim {

// The camera's chip. A pixel's electrons are radiance · time · sensitivity; its code is
// response(electrons · gain / full well) · full scale + black level, rounded and clipped.
struct SensorOptions {
  double sensitivity_e = 1e6;  // electrons per J/(m²·sr)
  double full_well_e = 20000;  // electrons at full scale and 0 dB
  double read_noise_e = 4;     // standard deviation
  bool photon_noise = true;    // Poisson
  double black_level =
      0;  // code without light, at the chip's full bit depth; scaled for 8-bit formats
  // Code / full scale at equally spaced exposures from 0 to full well, non-decreasing, at least 2 entries; empty: linear.
  std::vector<double> response;
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
  size_t cache_bytes = size_t{512} << 20;
  double lamp_intensity_w_sr = 10;  // of one lamp at level 1, straight ahead
  double projector_intensity_w_sr =
      10;  // on the axis, at pattern value 1; even on a wall square to the axis
  SensorOptions sensor;
  Faults faults;
};

}  // namespace lightstage::sim
