#include "sim/render/illuminate.h"

#include <cmath>
#include <numbers>
#include <span>

#include "sim/render/hash.h"
#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

void Copy(const Vec3& from, float* to) {
  for (int c = 0; c < 3; ++c) to[c] = static_cast<float>(from[c]);
}

}  // namespace

DiscLight LampLight(const BraceGeometry& brace, int lamp, Angle azimuth, double intensity_w_sr,
                    uint64_t seed) {
  const Vec3 direction = LampDirection(brace.lamps[lamp], azimuth);
  // Every lamp and pose turns the samples' points on the disc its own way: their noise is independent.
  const uint64_t hash = Fold(Fold(seed, static_cast<uint64_t>(lamp)), azimuth.degrees());
  const double turn = 2 * std::numbers::pi * UnitFloat(hash);
  const Vec3 across = direction.unitOrthogonal(), up = direction.cross(across);
  const double radius = brace.lamp_radius.meters();
  DiscLight light;
  Copy(brace.radius.meters() * direction, light.center);
  Copy(radius * (std::cos(turn) * across + std::sin(turn) * up), light.u);
  Copy(radius * (std::cos(turn) * up - std::sin(turn) * across), light.v);
  Copy(-direction, light.axis);
  light.radius = static_cast<float>(radius);
  light.intensity = static_cast<float>(intensity_w_sr);
  return light;
}

PinholeLight ProjectorLight(const ProjectorGeometry& projector, const Pose& pose,
                            double intensity_w_sr) {
  const ViewFrame frame = ProjectorFrame(projector, pose);
  PinholeLight light;
  Copy(frame.position, light.position);
  Copy(frame.right, light.right);
  Copy(frame.down, light.down);
  Copy(frame.forward, light.forward);
  light.tan_x = static_cast<float>(std::tan(projector.field_of_view.radians() / 2));
  light.tan_y =
      light.tan_x * static_cast<float>(projector.height) / static_cast<float>(projector.width);
  light.width = projector.width;
  light.height = projector.height;
  light.intensity = static_cast<float>(intensity_w_sr);
  return light;
}

Image Illuminate(const Scene& scene, const Paths& paths, const DiscLight& light) {
  Image image(paths.width(), paths.height(), 3);
  const float share = 1.0f / static_cast<float>(paths.samples());
  ForRows(paths.height(), [&](int y) {
    const Paths::Row& vertices = paths.row(y);
    thread_local std::vector<float> buffer;
    buffer.resize(3 * vertices.count);
    float *r = buffer.data(), *g = r + vertices.count, *b = g + vertices.count;
    BestKernels().disc(scene.handle(), vertices.arrays, light, vertices.count, r, g, b);
    std::span<float> row = image.row(y);
    for (int x = 0; x < paths.width(); ++x) {
      float sum[3] = {0, 0, 0};
      for (uint32_t i = vertices.first[x]; i < vertices.first[x + 1]; ++i) {
        sum[0] += r[i];
        sum[1] += g[i];
        sum[2] += b[i];
      }
      for (int c = 0; c < 3; ++c) row[3 * x + c] = share * sum[c];
    }
  });
  return image;
}

ProjectorTransport Illuminate(const Scene& scene, const Paths& paths, const PinholeLight& light) {
  const int width = paths.width(), height = paths.height();
  const float share = 1.0f / static_cast<float>(paths.samples());
  struct Row {
    std::vector<uint32_t> counts, source;
    std::vector<float> rgb;
  };
  std::vector<Row> rows(height);
  ForRows(height, [&](int y) {
    const Paths::Row& vertices = paths.row(y);
    thread_local std::vector<float> buffer;
    thread_local std::vector<uint32_t> pixels;
    buffer.resize(3 * vertices.count);
    pixels.resize(vertices.count);
    float *r = buffer.data(), *g = r + vertices.count, *b = g + vertices.count;
    BestKernels().pinhole(scene.handle(), vertices.arrays, light, vertices.count, pixels.data(), r,
                          g, b);
    Row& row = rows[y];
    row.counts.resize(width);
    for (int x = 0; x < width; ++x) {
      for (uint32_t i = vertices.first[x]; i < vertices.first[x + 1]; ++i) {
        if (pixels[i] == kUnlit) continue;
        ++row.counts[x];
        row.source.push_back(pixels[i]);
        row.rgb.insert(row.rgb.end(), {share * r[i], share * g[i], share * b[i]});
      }
    }
  });

  ProjectorTransport out;
  out.width_ = width;
  size_t total = 0;
  for (const Row& row : rows) total += row.source.size();
  out.first_.reserve(static_cast<size_t>(width) * height + 1);
  out.source_.reserve(total);
  out.rgb_.reserve(3 * total);
  uint32_t at = 0;
  for (const Row& row : rows) {
    for (uint32_t count : row.counts) {
      out.first_.push_back(at);
      at += count;
    }
    out.source_.insert(out.source_.end(), row.source.begin(), row.source.end());
    out.rgb_.insert(out.rgb_.end(), row.rgb.begin(), row.rgb.end());
  }
  out.first_.push_back(at);
  return out;
}

void ProjectorTransport::Add(const Image& raster, float scale, Image* sum) const {
  const std::span<const float> values = raster.pixels();
  ForRows(sum->height(), [&](int y) {
    std::span<float> row = sum->row(y);
    for (int x = 0; x < width_; ++x) {
      const size_t pixel = static_cast<size_t>(y) * width_ + x;
      float r = 0, g = 0, b = 0;
      for (uint32_t s = first_[pixel]; s < first_[pixel + 1]; ++s) {
        const float value = values[source_[s]];
        if (value == 0) continue;
        r += value * rgb_[3 * size_t{s}];
        g += value * rgb_[3 * size_t{s} + 1];
        b += value * rgb_[3 * size_t{s} + 2];
      }
      float* out = &row[3 * static_cast<size_t>(x)];
      out[0] += scale * r;
      out[1] += scale * g;
      out[2] += scale * b;
    }
  });
}

size_t ProjectorTransport::bytes() const {
  return sizeof(uint32_t) * (first_.capacity() + source_.capacity()) +
         sizeof(float) * rgb_.capacity();
}

}  // namespace lightstage::sim
