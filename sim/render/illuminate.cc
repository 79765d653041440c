#include "sim/render/illuminate.h"

#include <algorithm>
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

// What one pixel of the projector gives to one of the camera.
struct Entry {
  uint32_t source;
  float r, g, b;
};

// Adds the block's entries, and where those of each pixel begin.
void AddEntries(const Scene& scene, const Paths& paths, const Paths::Block& block,
                const LensLight& light, RTCScene parts, std::vector<Entry>* entries,
                std::vector<uint32_t>* first) {
  // Light comes to a vertex by connection and, from a lens, along its next ray.
  const size_t ways = light.radius > 0 ? 2 : 1;
  const Contributions add(ways * block.count);
  thread_local std::vector<uint32_t> pixels;
  pixels.resize(ways * block.count);
  BestKernels().lens({scene.handle(), parts}, block.arrays, light, block.count, pixels.data(),
                     add.r, add.g, add.b);
  const std::vector<float> shares = Shares(paths, block, parts);
  for (int x = 0; x < block.width; ++x) {
    const size_t begin = entries->size();
    first->push_back(static_cast<uint32_t>(begin));
    for (size_t way = 0; way < ways; ++way) {
      for (uint32_t k = block.first[x]; k < block.first[x + 1]; ++k) {
        const size_t i = way * block.count + k;
        if (pixels[i] == kUnlit) continue;
        // Neighbouring samples are often lit by the same pixel of the projector.
        auto entry = std::find_if(entries->begin() + static_cast<ptrdiff_t>(begin), entries->end(),
                                  [&](const Entry& e) { return e.source == pixels[i]; });
        if (entry == entries->end()) entry = entries->insert(entry, {pixels[i], 0, 0, 0});
        entry->r += shares[x] * add.r[i];
        entry->g += shares[x] * add.g[i];
        entry->b += shares[x] * add.b[i];
      }
    }
  }
}

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
    const std::span<float> out = image.row(vertices.y).subspan(3 * static_cast<size_t>(vertices.x));
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
  ProjectorTransport out;
  out.rows_.resize(paths.height());
  const size_t blocks_per_row = paths.blocks().size() / paths.height();
  ForAll(paths.height(), [&](int y) {
    // The entries by pixels.
    thread_local std::vector<Entry> entries;
    thread_local std::vector<uint32_t> first;
    entries.clear();
    first.clear();
    for (const Paths::Block& block : paths.blocks().subspan(y * blocks_per_row, blocks_per_row)) {
      AddEntries(scene, paths, block, light, parts, &entries, &first);
    }
    first.push_back(static_cast<uint32_t>(entries.size()));

    ProjectorTransport::Row& row = out.rows_[y];
    const auto count = [&](uint32_t x) { return first[x + 1] - first[x]; };
    for (int x = 0; x < paths.width(); ++x) {
      if (count(x) > 0) row.pixels.push_back(x);
    }
    std::stable_sort(row.pixels.begin(), row.pixels.end(),
                     [&](uint32_t a, uint32_t b) { return count(a) > count(b); });
    row.source.reserve(entries.size());
    row.r.reserve(entries.size());
    row.g.reserve(entries.size());
    row.b.reserve(entries.size());
    size_t left = row.pixels.size();
    for (uint32_t layer = 0;; ++layer) {
      while (left > 0 && count(row.pixels[left - 1]) <= layer) --left;
      if (left == 0) break;
      row.layers.push_back(static_cast<uint32_t>(left));
      for (size_t i = 0; i < left; ++i) {
        const Entry& entry = entries[first[row.pixels[i]] + layer];
        row.source.push_back(static_cast<int32_t>(entry.source));
        row.r.push_back(entry.r);
        row.g.push_back(entry.g);
        row.b.push_back(entry.b);
      }
    }
    row.pixels.shrink_to_fit();
  });
  return out;
}

void ProjectorTransport::Add(const Image& raster, std::span<const float> scales, Image* sum) const {
  const float* const values = raster.pixels().data();
  ForAll(sum->height(), [&](int y) {
    const Row& row = rows_[y];
    const float scale = scales[y];
    if (scale == 0 || row.pixels.empty()) return;
    const size_t pixels = row.pixels.size();
    thread_local std::vector<float> buffer;
    buffer.assign(3 * pixels, 0.0f);
    float *const r = buffer.data(), *const g = r + pixels, *const b = g + pixels;
    size_t at = 0;
    for (uint32_t count : row.layers) {
      BestKernels().gather(values, &row.source[at], &row.r[at], &row.g[at], &row.b[at], count, r, g,
                           b);
      at += count;
    }
    std::span<float> out = sum->row(y);
    for (size_t i = 0; i < pixels; ++i) {
      float* const to = &out[3 * size_t{row.pixels[i]}];
      to[0] += scale * r[i];
      to[1] += scale * g[i];
      to[2] += scale * b[i];
    }
  });
}

size_t ProjectorTransport::bytes() const {
  size_t bytes = rows_.size() * sizeof(Row);
  for (const Row& row : rows_) {
    bytes += sizeof(uint32_t) * (row.pixels.capacity() + row.layers.capacity()) +
             sizeof(int32_t) * row.source.capacity() +
             sizeof(float) * (row.r.capacity() + row.g.capacity() + row.b.capacity());
  }
  return bytes;
}

}  // namespace lightstage::sim
