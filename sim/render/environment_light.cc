#include "sim/render/environment_light.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

// Where `target` falls in running sums, and its share of that step.
size_t Step(std::span<const double> ends, double target, double* share) {
  size_t i = std::upper_bound(ends.begin(), ends.end(), target) - ends.begin();
  i = std::min(i, ends.size() - 1);
  // Rounding may lead to a step of no height.
  while (i > 0 && ends[i] == ends[i - 1]) --i;
  const double begin = i == 0 ? 0 : ends[i - 1];
  *share = std::clamp((target - begin) / (ends[i] - begin), 0.0, 1.0);
  return i;
}

}  // namespace

EnvironmentLight::EnvironmentLight(const EnvironmentMap& map, Angle rotate)
    : map_(map), rotate_(rotate) {
  double rows = 0;
  for (int y = 0; y < map_.height(); ++y) {
    double row = 0;
    for (int x = 0; x < map_.width(); ++x) texel_end_.push_back(row += Weight(x, y));
    row_end_.push_back(rows += row);
  }
}

double EnvironmentLight::Weight(int x, int y) const {
  return std::max(map_.At(x, y).maxCoeff(), 0.0) * map_.SolidAngle(y);
}

Radiance EnvironmentLight::At(const Vec3& direction) const {
  return map_.Lookup(RotateAboutZ(direction, -rotate_)).max(0.0);
}

Radiance EnvironmentLight::At(const Vec3& /*point*/, const Vec3& direction) const {
  return At(direction);
}

SurroundingLight::Sample EnvironmentLight::Draw(double u, double v) const {
  const double total = row_end_.back();
  if (!(total > 0)) return {Vec3::UnitZ(), 0};
  double down, right;
  const auto y = static_cast<int>(Step(row_end_, v * total, &down));
  const std::span<const double> row(&texel_end_[static_cast<size_t>(y) * map_.width()],
                                    static_cast<size_t>(map_.width()));
  const auto x = static_cast<int>(Step(row, u * row.back(), &right));
  // Evenly by solid angle: the height is even between the texel's edges.
  const double top = std::cos(map_.TiltOfRow(y).radians()),
               bottom = std::cos(map_.TiltOfRow(y + 1).radians());
  const Angle tilt = Radians(std::acos(std::clamp(top + down * (bottom - top), -1.0, 1.0)));
  const Vec3 direction = DirectionFromAngles(map_.AzimuthOfColumn(x + right), tilt);
  return {RotateAboutZ(direction, rotate_), Weight(x, y) / total / map_.SolidAngle(y)};
}

double EnvironmentLight::Pdf(const Vec3& direction) const {
  const double total = row_end_.back();
  return total > 0 ? At(direction).maxCoeff() / total : 0;
}

namespace {

EnvironmentMap MeanOf(const std::vector<EnvironmentMap>& maps) {
  Image mean(maps.front().width(), maps.front().height(), 3);
  for (const EnvironmentMap& map : maps) {
    for (int y = 0; y < mean.height(); ++y) {
      for (int x = 0; x < mean.width(); ++x) {
        for (int c = 0; c < 3; ++c) {
          mean.at(x, y, c) +=
              static_cast<float>(std::max(map.At(x, y)[c], 0.0) / static_cast<double>(maps.size()));
        }
      }
    }
  }
  return *EnvironmentMap::FromImage(std::move(mean));  // of numbers that are some
}

}  // namespace

IncidentLightField::IncidentLightField(std::vector<EnvironmentMap> maps, int columns, int rows,
                                       const Vec3& origin, const Vec3& u, const Vec3& v)
    : maps_(std::move(maps)),
      columns_(columns),
      rows_(rows),
      origin_(origin),
      normal_(u.cross(v).normalized()),
      mean_(MeanOf(maps_), Angle()) {
  // The dual of u and v in their plane.
  to_column_ = v.cross(normal_) / u.dot(v.cross(normal_));
  to_row_ = normal_.cross(u) / v.dot(normal_.cross(u));
}

Radiance IncidentLightField::At(const Vec3& point, const Vec3& direction) const {
  // Almost along the plane the line crosses it far beyond the edge.
  const double slope = direction.dot(normal_);
  const double safe = std::abs(slope) > 1e-9 ? slope : std::copysign(1e-9, slope);
  const Vec3 crossing = point + (origin_ - point).dot(normal_) / safe * direction - origin_;
  const double column = std::clamp(crossing.dot(to_column_), 0.0, 1.0) * (columns_ - 1),
               row = std::clamp(crossing.dot(to_row_), 0.0, 1.0) * (rows_ - 1);
  const int x = std::min(static_cast<int>(column), std::max(columns_ - 2, 0)),
            y = std::min(static_cast<int>(row), std::max(rows_ - 2, 0));
  Radiance sum = Radiance::Zero();
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const double weight =
          (i == 1 ? column - x : 1 - (column - x)) * (j == 1 ? row - y : 1 - (row - y));
      if (weight > 0)
        sum += weight *
               maps_[static_cast<size_t>(y + j) * columns_ + x + i].Lookup(direction).max(0.0);
    }
  }
  return sum;
}

Image Illuminate(const Scene& scene, const Paths& paths, const SurroundingLight& light) {
  Image image(paths.width(), paths.height(), 3);
  const float share = 1.0f / static_cast<float>(paths.samples());
  ForAll(static_cast<int>(paths.blocks().size()), [&](int index) {
    const Paths::Block& block = paths.blocks()[index];
    const VertexArrays& v = block.arrays;
    // Per vertex: direction, radiance over density, density; then what comes of it.
    thread_local std::vector<float> buffer;
    buffer.assign(10 * block.count, 0.0f);
    float* a[10];
    for (int k = 0; k < 10; ++k) a[k] = buffer.data() + k * block.count;
    for (size_t i = 0; i < block.count; ++i) {
      if (v.nx[i] == 0 && v.ny[i] == 0 && v.nz[i] == 0 && v.medium[i] == 0) continue;
      // The vertex' point of the disc (paths.h), as the point of the square that it comes from.
      const double turn = std::atan2(v.disc_y[i], v.disc_x[i]) / (2 * std::numbers::pi);
      const double square = double{v.disc_x[i]} * v.disc_x[i] + double{v.disc_y[i]} * v.disc_y[i];
      const SurroundingLight::Sample s =
          light.Draw(turn < 0 ? turn + 1 : turn, std::min(square, 0.9999999));
      if (s.pdf <= 0) continue;
      const Radiance radiance = light.At(Vec3(v.x[i], v.y[i], v.z[i]), s.direction);
      for (int c = 0; c < 3; ++c) {
        a[c][i] = static_cast<float>(s.direction[c]);
        a[3 + c][i] = static_cast<float>(radiance[c] / s.pdf);
      }
      a[6][i] = static_cast<float>(s.pdf);
    }
    const FarLight far{a[0], a[1], a[2], a[3], a[4], a[5], a[6]};
    BestKernels().far({scene.handle(), nullptr}, v, far, block.count, a[7], a[8], a[9]);
    const std::span<float> out = image.row(block.y).subspan(3 * static_cast<size_t>(block.x));
    for (int x = 0; x < block.width; ++x) {
      Radiance sum = Radiance::Zero();
      for (uint32_t i = block.first[x]; i < block.first[x + 1]; ++i) {
        sum += Radiance(a[7][i], a[8][i], a[9][i]);
        if (v.pdf[i] <= 0 || std::isfinite(v.reach[i])) continue;
        // The next ray leaves the scene.
        const Vec3 direction = Vec3(v.wx[i], v.wy[i], v.wz[i]).normalized();
        const bool only = v.nx[i] == 0 && v.ny[i] == 0 && v.nz[i] == 0;
        const double weight = only ? 1 : v.pdf[i] / (v.pdf[i] + light.Pdf(direction));
        sum += weight * Radiance(v.fr[i], v.fg[i], v.fb[i]) *
               light.At(Vec3(v.x[i], v.y[i], v.z[i]), direction);
      }
      for (int c = 0; c < 3; ++c) out[3 * x + c] = share * static_cast<float>(sum[c]);
    }
  });
  return image;
}

}  // namespace lightstage::sim
