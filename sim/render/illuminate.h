// Lights connected to the camera's paths: how much each vertex brings, summed per pixel. Radiance in W/(m²·sr). Thread-safe; all cores
// work; the same bytes however many there are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/units.h"
#include "optics/image.h"
#include "optics/rig_geometry.h"
#include "sim/render/kernels.h"
#include "sim/render/paths.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

// Lamp `lamp` of the brace at level 1 with the turntable at `azimuth`, in the object frame: a Lambertian disc that faces the origin.
// `intensity_w_sr` along its axis. Lamp, azimuth and seed choose how the vertices' points on it are turned, so that the noise of one
// does not repeat in another.
DiscLight LampLight(const BraceGeometry& brace, int lamp, Angle azimuth, double intensity_w_sr,
                    uint64_t seed);

// The projector's lens. A radius of 0 is a pinhole, in focus everywhere.
struct LensOptions {
  Length radius;
  Length focus = Meters(1);  // from the lens to the plane in focus, along the axis; > 0
};

// The projector of the rig at level 1, in the object frame. Pose and seed choose how the vertices' points on the lens are turned.
LensLight ProjectorLight(const ProjectorGeometry& projector, const LensOptions& lens,
                         const Pose& pose, double intensity_w_sr, uint64_t seed);

// The camera's picture, 3 channels. `parts` of the rig that may stand in the light or before the camera (rig_parts.h), black; null for
// none.
Image Illuminate(const Scene& scene, const Paths& paths, const DiscLight& light,
                 RTCScene parts = nullptr);

// What the projector gives at one pose: for every camera pixel, which projector pixels light it, and what each adds.
class ProjectorTransport {
 public:
  // sum += scale of the row · radiance of `raster`, what the projector's native pixels show (optics/pattern.h Rasterize). `scales`: one
  // per row of the picture. `sum`: the picture's size, 3 channels.
  void Add(const Image& raster, std::span<const float> scales, Image* sum) const;
  void Add(const Image& raster, float scale, Image* sum) const {
    Add(raster, std::vector<float>(sum->height(), scale), sum);
  }
  size_t bytes() const;

 private:
  friend ProjectorTransport Illuminate(const Scene& scene, const Paths& paths,
                                       const LensLight& light, RTCScene parts);
  // A row of the picture as a sparse matrix in jagged diagonals (Saad, "Iterative Methods for Sparse Linear Systems", 2003, 3.4): the
  // pixels are in order of how many entries they have, most first, and entry l of all that have so many is layer l. So the loops
  // over a layer are long and without branches.
  struct Row {
    std::vector<uint32_t> pixels;  // columns of the pixels that have entries
    std::vector<uint32_t> layers;  // how many entries each has, of the first so many pixels
    std::vector<int32_t> source;   // per entry: the projector's pixel
    std::vector<float> r, g,
        b;  // per entry: what that adds to the camera pixel's radiance when it is white
  };
  std::vector<Row> rows_;
};

ProjectorTransport Illuminate(const Scene& scene, const Paths& paths, const LensLight& light,
                              RTCScene parts = nullptr);

}  // namespace lightstage::sim
