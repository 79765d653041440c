// Light from all around, in the object frame: an environment map, infinitely far away, or an incident light field, which differs from place
// to place.
#pragma once

#include <vector>

#include "optics/environment_map.h"
#include "sim/render/illuminate.h"

namespace lightstage::sim {

// Thread-safe: it is only read.
class SurroundingLight {
 public:
  virtual ~SurroundingLight() = default;

  // Radiance that comes to a point from a unit direction.
  virtual Radiance At(const Vec3& point, const Vec3& direction) const = 0;

  struct Sample {
    Vec3 direction;  // unit
    double pdf;      // 1/sr; 0 if there is no light
  };
  // About by how much light comes from there; u, v in [0,1).
  virtual Sample Draw(double u, double v) const = 0;
  // Of drawing this direction; above 0 wherever light can come from.
  virtual double Pdf(const Vec3& direction) const = 0;
};

class EnvironmentLight final : public SurroundingLight {
 public:
  // `rotate`: the map is turned by so much about +Z, counterclockwise from above. Negative values of the map count as 0.
  EnvironmentLight(const EnvironmentMap& map, Angle rotate);

  bool IsBlack() const { return !(row_end_.back() > 0); }

  // The same everywhere.
  Radiance At(const Vec3& direction) const;
  Radiance At(const Vec3& point, const Vec3& direction) const override;
  // By radiance (its greatest channel) · solid angle.
  Sample Draw(double u, double v) const override;
  double Pdf(const Vec3& direction) const override;

 private:
  double Weight(int x, int y) const;

  const EnvironmentMap map_;
  const Angle rotate_;
  std::vector<double> row_end_;    // running sums of the rows' weights
  std::vector<double> texel_end_;  // within each row, running sums of its texels' weights
};

// Environment maps as they were taken at the points of a grid on a plane (dissertation, "incident light field"). Radiance does not change
// along a line, so what comes to a point is what crosses the plane on the same line: bilinear between the four maps around, and
// beyond the grid's edge as at the edge.
class IncidentLightField final : public SurroundingLight {
 public:
  // Map (column, row) stands at origin + u · column/(columns − 1) + v · row/(rows − 1); with one column or row there is no change along
  // it. `maps`: row by row, columns · rows of one size. u and v must not be parallel.
  IncidentLightField(std::vector<EnvironmentMap> maps, int columns, int rows, const Vec3& origin,
                     const Vec3& u, const Vec3& v);

  bool IsBlack() const { return mean_.IsBlack(); }

  Radiance At(const Vec3& point, const Vec3& direction) const override;
  // By the mean of all maps.
  Sample Draw(double u, double v) const override { return mean_.Draw(u, v); }
  double Pdf(const Vec3& direction) const override { return mean_.Pdf(direction); }

 private:
  const std::vector<EnvironmentMap> maps_;
  const int columns_, rows_;
  const Vec3 origin_, normal_;
  Vec3 to_column_, to_row_;  // (point − origin) · these: 0 to 1 across the grid
  const EnvironmentLight mean_;
};

// As Illuminate() of illuminate.h. What reaches the camera straight from the light is part of the picture.
Image Illuminate(const Scene& scene, const Paths& paths, const SurroundingLight& light);

}  // namespace lightstage::sim
