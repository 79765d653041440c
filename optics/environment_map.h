// An environment map: incident radiance by direction, as a latitude-longitude picture of the whole sphere.
//
// Convention: the picture as one sees it from inside, as OpenEXR and most panoramas have it. Row 0 is at the zenith (+Z, our up; OpenEXR's
// +Y), the last row at the nadir. Azimuth is OpenEXR's longitude: 0° (+X) in the middle of the picture, decreasing to the right,
// from +180° at the left edge to −180° at the right one. Texels are areas: texel (x,y) covers azimuths 180° − 360°·(x … x+1)/width and
// tilts 180°·(y … y+1)/height with constant radiance, so its centre is half a texel in. (OpenEXR's specification puts the first and
// the last column on one meridian; most writers, and we, do not.)
#pragma once

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "base/units.h"
#include "optics/direction.h"
#include "optics/image.h"

namespace lightstage {

using Radiance = Eigen::Array3d;  // R, G, B; a grey map has three equal ones

class EnvironmentMap {
 public:
  // `image` has 1 or 3 channels and finite values; negative ones (a resampling filter's lobes) are kept, since light adds.
  // INVALID_ARGUMENT / ENVIRONMENT_INVALID otherwise, naming the texel.
  static absl::StatusOr<EnvironmentMap> FromImage(Image image);

  int width() const { return image_.width(); }
  int height() const { return image_.height(); }
  bool is_grey() const { return image_.channels() == 1; }

  Radiance At(int x, int y) const;
  // The texel that contains a direction (of any length > 0).
  Radiance Lookup(const Vec3& direction) const;

  // Bounds of texels; column width() and row height() close the last ones.
  Angle AzimuthOfColumn(double x) const { return Degrees(180 - 360 * x / width()); }
  Angle TiltOfRow(double y) const { return Degrees(180 * y / height()); }
  // Of one texel of row y, exact: Δφ (cos θ0 − cos θ1), sr.
  double SolidAngle(int y) const;

  // ∫ radiance dω over the sphere.
  Radiance TotalPower() const;

 private:
  explicit EnvironmentMap(Image image) : image_(std::move(image)) {}
  Image image_;
};

}  // namespace lightstage
