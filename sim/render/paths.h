// Where light that the camera sees was scattered: the paths from the camera into the scene, traced backwards.
//
// Object and camera ride on the turntable together, so the paths do not depend on the pose or on what is lit: they are traced once per
// scene and picture size, and lamps and projector are connected to their vertices afterwards (kernels.h). That is path tracing with
// next-event estimation, with the paths kept. Only what turns otherwise than the object - the lights - is not part of the scene.
//
// A vertex is either a scattering surface or a point in a medium, to which lights are connected, or a mere origin of a ray (the camera, a mirror, glass): then
// its normal is 0 and only a light that the ray meets counts. Glossy surfaces take light both ways, weighted by the balance heuristic
// (Veach, "Robust Monte Carlo Methods", 1997, eq. 9.8).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "optics/rig_geometry.h"
#include "sim/render/kernels.h"
#include "sim/render/scene.h"
#include "sim/render/slabs.h"

namespace lightstage::sim {

struct PathOptions {
  int samples = 8;  // paths per pixel, [1, 65536]
  // How often light may be scattered between surfaces before the last scattering towards the camera: 0 is direct light only. Mirrors
  // and glass count.
  int bounces = 0;  // [0, kMostBounces]
  uint64_t seed = 1;
  // No light is nearer to the origin than this, m, and all shine inwards: camera rays that end farther in need not be kept to meet
  // one.
  float clear_radius = 0;
};

// Paths longer than this are cut; long before, Russian roulette has ended all but those among perfect reflectors.
inline constexpr int kMostBounces = 1000;

class Paths {
 public:
  // The same for the same seed, however many threads there are.
  Paths(const Scene& scene, const CameraGeometry& camera, int width, int height,
        const PathOptions& options);

  int width() const { return width_; }
  int height() const { return height_; }
  int samples() const { return samples_; }
  const CameraGeometry& camera() const { return camera_; }

  // Some pixels of a row and their vertices, in order of x: small enough for the nearest cache.
  struct Block {
    int x, y, width;   // the pixels [x, x + width) of row y
    size_t count = 0;  // vertices, padded to a multiple of kLanes with ones that take no light
    std::vector<uint32_t>
        first;  // width + 1: pixel x + i has the vertices [first[i], first[i + 1])
    VertexArrays arrays{};
  };
  // From left to right, row by row: all pixels, each once.
  std::span<const Block> blocks() const { return blocks_; }

 private:
  const CameraGeometry camera_;
  const int width_, height_, samples_;
  std::vector<Block> blocks_;
  Slabs slabs_;  // what the blocks' arrays lie in
};

// About how much memory the paths of a picture take at most, bytes: a few are traced to know.
size_t EstimatePathBytes(const Scene& scene, const CameraGeometry& camera, int width, int height,
                         const PathOptions& options);

}  // namespace lightstage::sim
