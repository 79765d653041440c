// An environment map as a light: infinitely far away all around, in the object frame.
#pragma once

#include <vector>

#include "optics/environment_map.h"
#include "sim/render/illuminate.h"

namespace lightstage::sim {

class EnvironmentLight {
 public:
  // `rotate`: the map is turned by so much about +Z, counterclockwise from above. Negative values of the map count as 0.
  EnvironmentLight(const EnvironmentMap& map, Angle rotate);

  // Radiance from a unit direction.
  Radiance At(const Vec3& direction) const;

  bool IsBlack() const { return !(row_end_.back() > 0); }

  struct Sample {
    Vec3 direction;     // unit
    Radiance radiance;  // from there
    double pdf;         // 1/sr; 0 if the map is black
  };
  // By radiance (its greatest channel) · solid angle; u, v in [0,1).
  Sample Draw(double u, double v) const;
  // Of drawing this direction.
  double Pdf(const Vec3& direction) const;

 private:
  size_t TexelOf(const Vec3& direction) const;
  double Weight(int x, int y) const;

  const EnvironmentMap map_;
  const Angle rotate_;
  std::vector<double> row_end_;    // running sums of the rows' weights
  std::vector<double> texel_end_;  // within each row, running sums of its texels' weights
};

// As Illuminate() of illuminate.h. What reaches the camera straight from the map is part of the picture.
Image Illuminate(const Scene& scene, const Paths& paths, const EnvironmentLight& light);

}  // namespace lightstage::sim
