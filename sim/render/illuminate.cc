#include "sim/render/illuminate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "sim/render/hash.h"
#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

void Copy(const Vec3& from, float* to) {
  for (int c = 0; c < 3; ++c) to[c] = static_cast<float>(from[c]);
}

// Two axes of length `radius` across `a` and `b` (unit, square to each other), turned.
void CopyTurned(const Vec3& a, const Vec3& b, double turn, double radius, float* u, float* v) {
  Copy(radius * (std::cos(turn) * a + std::sin(turn) * b), u);
  Copy(radius * (std::cos(turn) * b - std::sin(turn) * a), v);
}

double Turn(uint64_t hash) { return 2 * std::numbers::pi * UnitFloat(hash); }

// What the vertices of the block's pixel x add up to is to be multiplied by shares[x]: one over the samples, less what the rig's parts
// hide of the pixel.
std::vector<float> Shares(const Paths& paths, const Paths::Block& block, RTCScene parts) {
  const float share = 1.0f / static_cast<float>(paths.samples());
  std::vector<float> shares(block.width, share);
  if (parts == nullptr) return shares;
  constexpr int kAcross = 4;  // 16 rays per pixel
  const ViewFrame frame = CameraFrame(paths.camera());
  const double tan_x = std::tan(paths.camera().field_of_view.radians() / 2);
  const double tan_y = tan_x * paths.height() / paths.width();
  for (int x = 0; x < block.width; ++x) {
    int hidden = 0;
    for (int i = 0; i < kAcross * kAcross; ++i) {
      const int row = i / kAcross;
      const double px = block.x + x + (i % kAcross + 0.5) / kAcross,
                   py = block.y + (row + 0.5) / kAcross;
      const Vec3 direction = frame.forward + (px / paths.width() * 2 - 1) * tan_x * frame.right +
                             (py / paths.height() * 2 - 1) * tan_y * frame.down;
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      RTCRay ray = {};
      ray.org_x = static_cast<float>(frame.position.x());
      ray.org_y = static_cast<float>(frame.position.y());
      ray.org_z = static_cast<float>(frame.position.z());
      ray.dir_x = static_cast<float>(direction.x());
      ray.dir_y = static_cast<float>(direction.y());
      ray.dir_z = static_cast<float>(direction.z());
      // As far as the middle of the turntable: parts behind the object do not hide it.
      ray.tfar = static_cast<float>(frame.position.norm());
      ray.mask = ~0u;
      rtcOccluded1(parts, &context, &ray);
      hidden += ray.tfar < 0;
    }
    shares[x] *= 1 - static_cast<float>(hidden) / (kAcross * kAcross);
  }
  return shares;
}

// What a kernel writes per vertex of a block; reused from block to block.
struct Contributions {
  explicit Contributions(size_t count) {
    thread_local std::vector<float> buffer;
    buffer.resize(3 * count);
    r = buffer.data();
    g = r + count;
    b = g + count;
  }
  float *r, *g, *b;
};

}  // namespace

DiscLight LampLight(const BraceGeometry& brace, int lamp, Angle azimuth, double intensity_w_sr,
                    uint64_t seed) {
  const Vec3 direction = LampDirection(brace.lamps[lamp], azimuth);
  const Vec3 across = direction.unitOrthogonal(), up = direction.cross(across);
  const double radius = brace.lamp_radius.meters();
  DiscLight light;
  Copy(brace.radius.meters() * direction, light.center);
  // Every lamp and pose turns the samples' points on the disc its own way: their noise is independent.
  const uint64_t hash = Fold(Fold(seed, static_cast<uint64_t>(lamp)), azimuth.degrees());
  CopyTurned(across, up, Turn(hash), radius, light.u, light.v);
  Copy(-direction, light.axis);
  light.radius = static_cast<float>(radius);
  light.intensity = static_cast<float>(intensity_w_sr);
  return light;
}

LensLight ProjectorLight(const ProjectorGeometry& projector, const LensOptions& lens,
                         const Pose& pose, double intensity_w_sr, uint64_t seed) {
  const ViewFrame frame = ProjectorFrame(projector, pose);
  LensLight light;
  Copy(frame.position, light.position);
  Copy(frame.right, light.right);
  Copy(frame.down, light.down);
  Copy(frame.forward, light.forward);
  const uint64_t hash = Fold(Fold(seed, pose.azimuth.degrees()), pose.tilt.degrees());
  CopyTurned(frame.right, frame.down, Turn(hash), lens.radius.meters(), light.u, light.v);
  light.radius = static_cast<float>(lens.radius.meters());
  light.focus = static_cast<float>(lens.focus.meters());
  light.tan_x = static_cast<float>(std::tan(projector.field_of_view.radians() / 2));
  light.tan_y =
      light.tan_x * static_cast<float>(projector.height) / static_cast<float>(projector.width);
  light.width = projector.width;
  light.height = projector.height;
  light.intensity = static_cast<float>(intensity_w_sr);
  return light;
}

Image Illuminate(const Scene& scene, const Paths& paths, const DiscLight& light, RTCScene parts) {
  Image image(paths.width(), paths.height(), 3);
  ForAll(static_cast<int>(paths.blocks().size()), [&](int block) {
    const Paths::Block& vertices = paths.blocks()[block];
    const Contributions add(vertices.count);
    BestKernels().disc({scene.handle(), parts}, vertices.arrays, light, vertices.count, add.r,
                       add.g, add.b);
    const std::vector<float> shares = Shares(paths, vertices, parts);
    float* const out = &image.row(vertices.y)[3 * size_t{vertices.x}];
    for (int x = 0; x < vertices.width; ++x) {
      float sum[3] = {0, 0, 0};
      for (uint32_t i = vertices.first[x]; i < vertices.first[x + 1]; ++i) {
        sum[0] += add.r[i];
        sum[1] += add.g[i];
        sum[2] += add.b[i];
      }
      for (int c = 0; c < 3; ++c) out[3 * x + c] = shares[x] * sum[c];
    }
  });
  return image;
}

ProjectorTransport Illuminate(const Scene& scene, const Paths& paths, const LensLight& light,
                              RTCScene parts) {
  const int width = paths.width(), height = paths.height();
  struct Entries {
    std::vector<uint32_t> counts, source;
    std::vector<float> rgb;
  };
  std::vector<Entries> blocks(paths.blocks().size());
  ForAll(static_cast<int>(blocks.size()), [&](int block) {
    const Paths::Block& vertices = paths.blocks()[block];
    // Light comes to a vertex by connection and, from a lens, along its next ray.
    const size_t ways = light.radius > 0 ? 2 : 1;
    const Contributions add(ways * vertices.count);
    thread_local std::vector<uint32_t> pixels;
    pixels.resize(ways * vertices.count);
    BestKernels().lens({scene.handle(), parts}, vertices.arrays, light, vertices.count,
                       pixels.data(), add.r, add.g, add.b);
    const std::vector<float> shares = Shares(paths, vertices, parts);
    Entries& to = blocks[block];
    to.counts.resize(vertices.width);
    for (int x = 0; x < vertices.width; ++x) {
      const size_t begin = to.source.size();
      for (size_t way = 0; way < ways; ++way) {
        for (uint32_t k = vertices.first[x]; k < vertices.first[x + 1]; ++k) {
          const size_t i = way * vertices.count + k;
          if (pixels[i] == kUnlit) continue;
          // Neighbouring samples are often lit by the same pixel of the projector.
          const size_t at = std::find(to.source.begin() + static_cast<ptrdiff_t>(begin),
                                      to.source.end(), pixels[i]) -
                            to.source.begin();
          if (at == to.source.size()) {
            to.source.push_back(pixels[i]);
            to.rgb.insert(to.rgb.end(), {0.0f, 0.0f, 0.0f});
          }
          to.rgb[3 * at] += shares[x] * add.r[i];
          to.rgb[3 * at + 1] += shares[x] * add.g[i];
          to.rgb[3 * at + 2] += shares[x] * add.b[i];
        }
      }
      to.counts[x] = static_cast<uint32_t>(to.source.size() - begin);
    }
  });

  ProjectorTransport out;
  out.width_ = width;
  size_t total = 0;
  for (const Entries& block : blocks) total += block.source.size();
  out.first_.reserve(static_cast<size_t>(width) * height + 1);
  out.source_.reserve(total);
  out.rgb_.reserve(3 * total);
  uint32_t at = 0;
  for (const Entries& block : blocks) {
    for (uint32_t count : block.counts) {
      out.first_.push_back(at);
      at += count;
    }
    out.source_.insert(out.source_.end(), block.source.begin(), block.source.end());
    out.rgb_.insert(out.rgb_.end(), block.rgb.begin(), block.rgb.end());
  }
  out.first_.push_back(at);
  return out;
}

void ProjectorTransport::Add(const Image& raster, std::span<const float> scales, Image* sum) const {
  const std::span<const float> values = raster.pixels();
  ForAll(sum->height(), [&](int y) {
    const float scale = scales[y];
    if (scale == 0) return;
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
