#include "optics/environment_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/status.h"

namespace lightstage {

absl::StatusOr<EnvironmentMap> EnvironmentMap::FromImage(Image image) {
  auto bad = [](const std::string& message, const ErrorMetadata& metadata) {
    return Error(absl::StatusCode::kInvalidArgument, "ENVIRONMENT_INVALID", message, metadata);
  };
  if (image.empty() || (image.channels() != 1 && image.channels() != 3)) {
    return bad(absl::StrCat("an environment map of ", image.width(), "×", image.height(), " with ",
                            image.channels(), " channels; it must have 1 or 3"),
               {{"width", absl::StrCat(image.width())},
                {"height", absl::StrCat(image.height())},
                {"channels", absl::StrCat(image.channels())}});
  }
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      for (int c = 0; c < image.channels(); ++c) {
        if (std::isfinite(image.at(x, y, c))) continue;
        return bad(absl::StrCat("environment map texel (", x, ", ", y, ") is ", image.at(x, y, c),
                                "; every value must be finite"),
                   {{"x", absl::StrCat(x)},
                    {"y", absl::StrCat(y)},
                    {"value", absl::StrCat(image.at(x, y, c))}});
      }
    }
  }
  return EnvironmentMap(std::move(image));
}

Radiance EnvironmentMap::At(int x, int y) const {
  if (is_grey()) return Radiance::Constant(image_.at(x, y, 0));
  return {image_.at(x, y, 0), image_.at(x, y, 1), image_.at(x, y, 2)};
}

Radiance EnvironmentMap::Lookup(const Vec3& direction) const {
  const AzimuthTilt angles = AnglesOfDirection(direction);
  const double turns = WrapTurn(Degrees(180) - angles.azimuth).degrees() / 360;
  const double v = angles.tilt.degrees() / 180;
  return At(std::min(static_cast<int>(turns * width()), width() - 1),
            std::min(static_cast<int>(v * height()), height() - 1));
}

double EnvironmentMap::SolidAngle(int y) const {
  return 2 * std::numbers::pi / width() *
         (std::cos(TiltOfRow(y).radians()) - std::cos(TiltOfRow(y + 1).radians()));
}

Radiance EnvironmentMap::TotalPower() const {
  Radiance total = Radiance::Zero();
  for (int y = 0; y < height(); ++y) {
    Radiance row = Radiance::Zero();
    for (int x = 0; x < width(); ++x) row += At(x, y);
    total += SolidAngle(y) * row;
  }
  return total;
}

}  // namespace lightstage
