#include "sim/render/paths.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <numbers>
#include <optional>

#include "sim/render/hash.h"
#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

#include "sim/render/bsdf.inc"

// Rays start this far above the surface: far more than the rounding of coordinates of a metre, far less than any detail.
constexpr float kLift = 2e-5f;
// A boundary of a medium is passed by so much. To meet it once more would do no harm: it is entered or left as before.
constexpr float kBeyond = 1e-6f;
constexpr size_t kAlignment = 64;  // bytes, a cache line
constexpr float kInfinity = std::numeric_limits<float>::infinity();
// Glossier layers take what their next ray meets; on rougher ones connecting the light is good enough, and saves that ray.
constexpr float kGlossy = 0.25f;
// From here on paths end by Russian roulette.
constexpr int kRouletteFrom = 3;
// No path passes through more boundaries of media between two vertices.
constexpr uint32_t kMostCrossings = 1000;

float Fraction(float x) { return x - std::floor(x); }

struct Point2 {
  float x, y;
};

// The points of one pixel in one pair of dimensions: the R2 sequence (Roberts 2018), shifted and in an order of its own, so that no two
// pairs of dimensions go together.
class PixelPoints {
 public:
  PixelPoints(uint64_t pixel, uint32_t samples) : pixel_(pixel), samples_(samples) {}

  Point2 At(uint32_t dimension, uint32_t sample) const {
    const uint64_t key = Mix(pixel_ + dimension * 0x9e3779b97f4a7c15u), shift = Mix(key);
    const auto i = static_cast<float>(Permute(sample, samples_, key));
    return {Fraction(UnitFloat(shift) + 0.7548777f * i),
            Fraction(UnitFloat(shift << 24) + 0.5698403f * i)};
  }

 private:
  const uint64_t pixel_;
  const uint32_t samples_;
};

// The dimensions of a path: the pixel's, then these for every vertex.
constexpr uint32_t kPixelDimension = 0;
enum VertexDimension : uint32_t {
  kDirection = 1,
  kDisc,
  kChoice,
  kRoulette,
  kDistance,
  kVertexDimensions
};
uint32_t Dimension(int depth, VertexDimension d) {
  return static_cast<uint32_t>(depth) * kVertexDimensions + d;
}

struct Frame3 {
  explicit Frame3(const Vec3f& normal)
      : n(normal), t(normal.unitOrthogonal()), b(normal.cross(t)) {}
  Vec3f ToLocal(const Vec3f& v) const { return {v.dot(t), v.dot(b), v.dot(n)}; }
  Vec3f ToWorld(const Vec3f& v) const { return v.x() * t + v.y() * b + v.z() * n; }
  Vec3f n, t, b;
};

// Cosine and sine of a turn in [0, 1], to 1e-6: Taylor's series around the nearest quarter.
Point2 OnCircle(float turn) {
  const int quarter =
      static_cast<int>(4 * turn + 0.5f);  // NOLINT(bugprone-incorrect-roundings): never negative
  const float x = 2 * std::numbers::pi_v<float> * (turn - 0.25f * static_cast<float>(quarter)),
              x2 = x * x;
  const float sine = x * (1 - x2 * (1.0f / 6 - x2 * (1.0f / 120 - x2 * (1.0f / 5040))));
  const float cosine = 1 - x2 * (0.5f - x2 * (1.0f / 24 - x2 * (1.0f / 720 - x2 * (1.0f / 40320))));
  switch (quarter & 3) {
    case 0:
      return {cosine, sine};
    case 1:
      return {-sine, cosine};
    case 2:
      return {-cosine, -sine};
    default:
      return {sine, -cosine};
  }
}

// A point of the unit disc, evenly, for one of the unit square.
Point2 InDisc(Point2 u) {
  const float r = std::sqrt(u.x);
  const Point2 p = OnCircle(u.y);
  return {r * p.x, r * p.y};
}

Vec3f CosineDirection(Point2 u) {
  const Point2 disc = InDisc(u);
  return {disc.x, disc.y, std::sqrt(std::max(0.0f, 1 - u.x))};
}

// A microfacet normal that the viewer sees (Heitz, "Sampling the GGX Distribution of Visible Normals", 2018): a point of the disc that
// the stretched hemisphere projects to along the view.
Vec3f VisibleNormal(const Vec3f& view, float alpha, Point2 u) {
  const Vec3f stretched = Vec3f(alpha * view.x(), alpha * view.y(), view.z()).normalized();
  const Point2 disc = InDisc(u);
  // Along `across`, which is level, the disc is whole; along the other axis its lower half is hidden by the horizon.
  Vec3f across(-stretched.y(), stretched.x(), 0);
  const float length = across.norm();
  across = length > 1e-6f ? Vec3f(across / length) : Vec3f(1, 0, 0);
  const Vec3f along = stretched.cross(across);
  const float p = disc.x;
  const float s = 0.5f * (1 + stretched.z());
  const float q = (1 - s) * std::sqrt(std::max(0.0f, 1 - p * p)) + s * disc.y;
  const Vec3f normal =
      p * across + q * along + std::sqrt(std::max(0.0f, 1 - p * p - q * q)) * stretched;
  return Vec3f(alpha * normal.x(), alpha * normal.y(), std::max(0.0f, normal.z())).normalized();
}

// Fresnel's equations for unpolarised light from inside index n1 to n2 at the cosine of incidence; 1 in total reflection.
float Fresnel(float cosine, float n1, float n2, float* refracted_cosine) {
  const float ratio = n1 / n2;
  const float square = 1 - ratio * ratio * (1 - cosine * cosine);
  if (square <= 0) return 1;
  const float other = std::sqrt(square);
  *refracted_cosine = other;
  const float s = (n1 * cosine - n2 * other) / (n1 * cosine + n2 * other);
  const float p = (n2 * cosine - n1 * other) / (n2 * cosine + n1 * other);
  return 0.5f * (s * s + p * p);
}

// The cosine of a scattering angle (Henyey and Greenstein 1941).
float ScatteringCosine(float g, float u) {
  if (std::abs(g) < 1e-3f) return 1 - 2 * u;
  const float root = (1 - g * g) / (1 - g + 2 * g * u);
  return std::clamp((1 + g * g - root * root) / (2 * g), -1.0f, 1.0f);
}

// What a vertex keeps, in the order of VertexArrays.
struct Vertex {
  Vec3f position = Vec3f::Zero(), normal = Vec3f::Zero();
  float medium = 0;
  Vec3f view = Vec3f::Zero();
  Rgb throughput = Rgb::Zero(), diffuse = Rgb::Zero(), specular = Rgb::Zero();
  float roughness = 0, share = 0, mis = 0;
  float disc_x = 0, disc_y = 0;
  Vec3f next = Vec3f::Zero();
  Rgb behind = Rgb::Zero();  // throughput of the next ray
  float pdf = 0, reach = 0;
};
static_assert(sizeof(Vertex) == kVertexFloats * sizeof(float));

// A path that goes on: its ray.
struct Path {
  Vec3f origin, direction;
  Rgb throughput;
  uint32_t x, sample;
  int depth;        // of the vertex that the ray goes to
  bool last;        // only to learn how far the ray goes
  uint32_t vertex;  // that the ray comes from; kNone: the camera, and nothing is kept of it
  const Material* medium = nullptr;  // that it goes through
  float narrowed =
      1;  // part of the throughput that glass takes on entering and gives back on leaving
  float travelled = 0;     // from the vertex to the ray's origin: boundaries of media were passed
  uint32_t crossings = 0;  // how many …
  float near = 0;          // … and then the ray must not meet the last one again
};
constexpr uint32_t kNone = 0xffffffffu;

// What tracing a row needs, kept from row to row: its memory is touched already.
struct RowScratch {
  std::vector<uint64_t> pixel_keys;
  std::vector<Path> paths, going;
  std::vector<RTCRayHit8> hits;
  std::vector<Vertex> vertices;
  std::vector<uint32_t> pixels;
};

class RowTracer {
 public:
  RowTracer(const Scene& scene, const CameraGeometry& camera, int width, int height, int y,
            const PathOptions& options, RowScratch* scratch)
      : scene_(scene),
        options_(options),
        frame_(CameraFrame(camera)),
        tan_x_(std::tan(camera.field_of_view.radians() / 2)),
        width_(width),
        height_(height),
        y_(y),
        pixel_keys_(scratch->pixel_keys),
        paths_(scratch->paths),
        going_(scratch->going),
        hits_(scratch->hits),
        vertices_(scratch->vertices),
        pixels_(scratch->pixels) {}

  void Trace() {
    Begin();
    while (!paths_.empty()) {
      Intersect();
      going_.clear();
      for (size_t i = 0; i < paths_.size(); ++i) Arrive(paths_[i], i);
      paths_.swap(going_);
    }
  }

  const std::vector<Vertex>& vertices() const { return vertices_; }
  const std::vector<uint32_t>& pixels() const { return pixels_; }

 private:
  PixelPoints PointsOf(uint32_t x) const {
    return PixelPoints(pixel_keys_[x], static_cast<uint32_t>(options_.samples));
  }

  void Begin() {
    const double tan_y = tan_x_ * height_ / width_;
    const Vec3f origin = frame_.position.cast<float>();
    pixel_keys_.clear();
    paths_.clear();
    vertices_.clear();
    pixels_.clear();
    for (int x = 0; x < width_; ++x) {
      pixel_keys_.push_back(
          Fold(Fold(options_.seed, uint64_t{0x66696c6d}), static_cast<uint64_t>(y_) * width_ + x));
      const PixelPoints points = PointsOf(static_cast<uint32_t>(x));
      for (int s = 0; s < options_.samples; ++s) {
        const Point2 p = points.At(kPixelDimension, static_cast<uint32_t>(s));
        const Vec3 direction = frame_.forward +
                               ((x + p.x) / width_ * 2 - 1) * tan_x_ * frame_.right +
                               ((y_ + p.y) / height_ * 2 - 1) * tan_y * frame_.down;
        paths_.push_back({origin, direction.normalized().cast<float>(), Rgb::Ones(),
                          static_cast<uint32_t>(x), static_cast<uint32_t>(s), 0, false, kNone});
      }
    }
  }

  void Intersect() {
    const size_t blocks = (paths_.size() + kLanes - 1) / kLanes;
    if (hits_.size() < blocks) hits_.resize(blocks);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = paths_.front().depth == 0 ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                              : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    for (size_t block = 0; block < blocks; ++block) {
      RTCRayHit8& ray = hits_[block];
      alignas(32) int valid[kLanes];
      for (size_t k = 0; k < kLanes; ++k) {
        const size_t i = std::min(block * kLanes + k, paths_.size() - 1);
        const Path& path = paths_[i];
        valid[k] = block * kLanes + k < paths_.size() ? -1 : 0;
        ray.ray.org_x[k] = path.origin.x();
        ray.ray.org_y[k] = path.origin.y();
        ray.ray.org_z[k] = path.origin.z();
        ray.ray.dir_x[k] = path.direction.x();
        ray.ray.dir_y[k] = path.direction.y();
        ray.ray.dir_z[k] = path.direction.z();
        ray.ray.tnear[k] = path.near;
        ray.ray.tfar[k] = kInfinity;
        ray.ray.time[k] = 0;
        ray.ray.mask[k] = ~0u;
        ray.ray.id[k] = 0;
        ray.ray.flags[k] = 0;
        ray.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        ray.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
      }
      rtcIntersect8(valid, scene_.handle(), &context, &ray);
    }
  }

  // The ray of paths_[i] has met something, or nothing.
  void Arrive(const Path& path, size_t i) {
    const RTCRayHit8& ray = hits_[i / kLanes];
    const size_t k = i % kLanes;
    bool met = ray.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
    float length = met ? ray.ray.tfar[k] : kInfinity;
    bool scattered = false;
    std::optional<Scene::Hit> hit;
    if (met) {
      hit = scene_.Resolve({path.origin, path.direction},
                           {ray.hit.instID[0][k], ray.hit.geomID[k], ray.hit.primID[k],
                            ray.hit.u[k], ray.hit.v[k], length});
    }
    // A medium is closed: where nothing comes, or its outer side, its end was too thin to be met.
    const bool within =
        path.medium != nullptr && hit && !(hit->material == path.medium && hit->outside);
    if (within) {
      const float u =
          PointsOf(path.x)
              .At(Dimension(path.depth, kDistance) + (path.crossings << 16), path.sample)
              .x;
      const float free = -std::log(1 - u) / path.medium->extinction;
      scattered = free < length;
      length = std::min(free, length);
    }
    const Vec3f point = path.origin + (std::isfinite(length) ? length : 0.0f) * path.direction;
    if (hit && !scattered && hit->material->kind == Material::Kind::kMedium &&
        path.crossings < kMostCrossings) {
      return Cross(path, *hit, length);
    }
    const float reach = path.travelled + length;
    if (path.vertex != kNone) vertices_[path.vertex].reach = reach;
    if (path.vertex == kNone && !Clear(path, met, length)) {
      Vertex camera =
          Origin(path.origin - path.travelled * path.direction, path.direction, path.throughput);
      camera.reach = reach;
      Keep(camera, path.x);
    }
    if (!met || path.last) return;
    if (scattered) return ScatterInMedium(path, point);
    switch (hit->material->kind) {
      case Material::Kind::kSurface:
        return Scatter(path, *hit);
      case Material::Kind::kMirror:
        return Mirror(path, *hit);
      case Material::Kind::kGlass:
        return Glass(path, *hit);
      case Material::Kind::kMedium:
        return;
    }
  }

  // On through the boundary of a medium, still on the way from the same vertex.
  void Cross(const Path& path, const Scene::Hit& hit, float length) {
    Path on = path;
    on.origin = hit.point;
    on.near = kBeyond;
    on.medium = hit.outside ? hit.material : nullptr;
    on.travelled += length;
    ++on.crossings;
    going_.push_back(on);
  }

  void ScatterInMedium(const Path& path, const Vec3f& point) {
    const PixelPoints points = PointsOf(path.x);
    Vertex v;
    v.position = point;
    v.medium = 1;
    v.view = -path.direction;
    v.throughput = path.throughput;
    v.diffuse = path.medium->diffuse;
    if (path.medium->texture) v.diffuse *= path.medium->texture({.position = point});
    v.roughness = path.medium->anisotropy;
    const Point2 disc = InDisc(points.At(Dimension(path.depth, kDisc), path.sample));
    v.disc_x = disc.x;
    v.disc_y = disc.y;
    if (path.depth < options_.bounces) {
      const Point2 u = points.At(Dimension(path.depth, kDirection), path.sample);
      const float cosine = ScatteringCosine(v.roughness, u.x);
      const Point2 around = OnCircle(u.y);
      const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
      v.next =
          Frame3(path.direction).ToWorld({sine * around.x, sine * around.y, cosine}).normalized();
      v.behind = v.throughput * v.diffuse;
    }
    GoOn(path, Keep(v, path.x), points);
  }

  // True if no light can be met on this way from the camera: lights shine inwards, so only a ray on its way out meets one, and such
  // a ray does not end farther in.
  bool Clear(const Path& path, bool met, float length) const {
    return met && (path.origin + length * path.direction).norm() < options_.clear_radius;
  }

  // A vertex that only passes on what its next ray meets.
  static Vertex Origin(const Vec3f& position, const Vec3f& direction, const Rgb& throughput) {
    Vertex v;
    v.position = position;
    v.view = -direction;
    v.next = direction;
    v.behind = throughput;
    v.pdf = 1;
    return v;
  }

  uint32_t Keep(const Vertex& vertex, uint32_t x) {
    vertices_.push_back(vertex);
    pixels_.push_back(x);
    return static_cast<uint32_t>(vertices_.size() - 1);
  }

  void Scatter(const Path& path, const Scene::Hit& hit) {
    const Material& material = *hit.material;
    const PixelPoints points = PointsOf(path.x);
    const int depth = path.depth;
    Vertex v;
    v.position = hit.point + kLift * hit.face;
    v.normal = hit.normal;
    v.view = -path.direction;
    v.throughput = path.throughput;
    v.diffuse = hit.diffuse;
    v.specular = hit.specular;
    v.roughness = material.roughness;
    const float nv = std::max(v.normal.dot(v.view), kLeastCosine);
    if ((v.specular > 0).any()) {
      const float f0 = v.specular.mean();
      const float layer = f0 + (1 - f0) * Fifth(1 - nv);
      const float base = v.diffuse.mean() * (1 - f0);
      // Never too rarely: a layer that shines at the edge only is missed otherwise.
      v.share = base > 0 ? std::clamp(layer / (layer + base), 0.1f, 1.0f) : 1;
      v.mis = v.roughness < kGlossy ? 1.0f : 0.0f;
    }
    const Point2 disc = InDisc(points.At(Dimension(depth, kDisc), path.sample));
    v.disc_x = disc.x;
    v.disc_y = disc.y;

    const bool on = depth < options_.bounces;
    if (!on && v.mis == 0) {
      Keep(v, path.x);
      return;
    }
    const Point2 u = points.At(Dimension(depth, kDirection), path.sample);
    const Frame3 frame(v.normal);
    if (points.At(Dimension(depth, kChoice), path.sample).x < v.share) {
      const Vec3f half = frame.ToWorld(VisibleNormal(frame.ToLocal(v.view), v.roughness, u));
      v.next = 2 * half.dot(v.view) * half - v.view;
    } else {
      v.next = frame.ToWorld(CosineDirection(u));
    }
    v.next.normalize();
    const float nl = v.normal.dot(v.next);
    if (nl > 0 && hit.face.dot(v.next) > 0) {
      const Vec3f half = (v.view + v.next).normalized();
      const Cosines cosines{nl, nv, std::max(v.normal.dot(half), 0.0f),
                            std::max(v.view.dot(half), 0.0f)};
      const Reflection f =
          EvaluateSurface(cosines, v.diffuse[0], v.diffuse[1], v.diffuse[2], v.specular[0],
                          v.specular[1], v.specular[2], v.roughness, v.share);
      v.behind = v.throughput * Rgb(f.r, f.g, f.b) / f.pdf;
      v.pdf = v.mis * f.pdf;
    }
    GoOn(path, Keep(v, path.x), points);
  }

  void Mirror(const Path& path, const Scene::Hit& hit) {
    const Vec3f& d = path.direction;
    const Vec3f direction = d - 2 * d.dot(hit.normal) * hit.normal;
    if (hit.face.dot(direction) <= 0) return;
    const uint32_t vertex = Keep(Origin(hit.point + kLift * hit.face, direction.normalized(),
                                        path.throughput * hit.specular),
                                 path.x);
    GoOn(path, vertex, PointsOf(path.x));
  }

  void Glass(const Path& path, const Scene::Hit& hit) {
    const PixelPoints points = PointsOf(path.x);
    const Vec3f& d = path.direction;
    const float n1 = hit.outside ? 1 : hit.material->ior, n2 = hit.outside ? hit.material->ior : 1;
    const float cosine = std::min(-d.dot(hit.normal), 1.0f);
    if (cosine <= 0) return;
    float other = 0;
    const float reflectance = Fresnel(cosine, n1, n2, &other);
    Vec3f direction, position = hit.point;
    Rgb throughput = path.throughput;
    float narrowing = 1;
    if (points.At(Dimension(path.depth, kChoice), path.sample).x < reflectance) {
      direction = d + 2 * cosine * hit.normal;
      position += kLift * hit.face;
    } else {
      const float ratio = n1 / n2;
      direction = ratio * d + (ratio * cosine - other) * hit.normal;
      position -= kLift * hit.face;
      narrowing = ratio * ratio;  // radiance is narrowed on its way into the denser side
      throughput *= narrowing * hit.tint;
    }
    GoOn(path, Keep(Origin(position, direction.normalized(), throughput), path.x), points,
         narrowing);
  }

  // Sends the path along the next ray of `vertex`, if it is to have one.
  void GoOn(const Path& path, uint32_t vertex, const PixelPoints& points, float narrowing = 1) {
    const Vertex& v = vertices_[vertex];
    Rgb throughput = v.behind;
    if (!(throughput > 0).any()) return;
    bool last = path.depth >= options_.bounces;
    if (!last && path.depth >= kRouletteFrom) {
      const float survival =
          std::clamp(throughput.maxCoeff() / (path.narrowed * narrowing), 0.05f, 1.0f);
      if (points.At(Dimension(path.depth, kRoulette), path.sample).x >= survival) last = true;
      throughput /= survival;
    }
    if (last && v.pdf == 0) return;
    going_.push_back({v.position, v.next, throughput, path.x, path.sample, path.depth + 1, last,
                      vertex, path.medium, path.narrowed * narrowing});
  }

  const Scene& scene_;
  const PathOptions& options_;
  const ViewFrame frame_;
  const double tan_x_;
  const int width_, height_, y_;
  std::vector<uint64_t>& pixel_keys_;
  std::vector<Path>&paths_, &going_;
  std::vector<RTCRayHit8>& hits_;
  std::vector<Vertex>& vertices_;
  std::vector<uint32_t>& pixels_;
};

}  // namespace

void Paths::Row::Free::operator()(float* p) const {
  ::operator delete[](p, std::align_val_t{kAlignment});
}

size_t EstimatePathBytes(const Scene& scene, const CameraGeometry& camera, int width, int height,
                         const PathOptions& options) {
  // How many vertices paths have depends on the scene: a few are traced.
  constexpr int kAcross = 24, kDown = 18;
  PathOptions few = options;
  few.samples = 1;
  const Paths paths(scene, camera, kAcross, kDown, few);
  double vertices = 0;
  for (int y = 0; y < kDown; ++y) vertices += paths.row(y).first.back();
  const double per_path = vertices / (kAcross * kDown) * kVertexFloats * sizeof(float);
  return static_cast<size_t>(per_path * width * height * options.samples);
}

Paths::Paths(const Scene& scene, const CameraGeometry& camera, int width, int height,
             const PathOptions& options)
    : camera_(camera), width_(width), height_(height), samples_(options.samples), rows_(height) {
  ForRows(height, [&](int y) {
    thread_local RowScratch scratch;
    RowTracer tracer(scene, camera, width, height, y, options, &scratch);
    tracer.Trace();
    rows_[y].Fill(width, tracer.pixels(), reinterpret_cast<const float*>(tracer.vertices().data()));
  });
}

void Paths::Row::Fill(int width, const std::vector<uint32_t>& pixels, const float* vertices) {
  first.assign(static_cast<size_t>(width) + 1, 0);
  for (uint32_t x : pixels) ++first[x + 1];
  for (int x = 0; x < width; ++x) first[x + 1] += first[x];
  count = (pixels.size() + kLanes - 1) / kLanes * kLanes;
  if (count == 0) return;
  // The arrays lie a cache line more apart than they are long: at multiples of a page all of them would share a few places in the
  // cache.
  const size_t apart = count + kAlignment / sizeof(float);
  data.reset(static_cast<float*>(
      ::operator new[](apart* kVertexFloats * sizeof(float), std::align_val_t{kAlignment})));
  std::vector<uint32_t> next(first.begin(), first.end() - 1);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const uint32_t to = next[pixels[i]]++;
    for (int k = 0; k < kVertexFloats; ++k) data[k * apart + to] = vertices[i * kVertexFloats + k];
  }
  const float* pointers[kVertexFloats];
  for (int k = 0; k < kVertexFloats; ++k) {
    float* const array = &data[k * apart];
    std::fill(array + pixels.size(), array + count, 0.0f);
    pointers[k] = array;
  }
  static_assert(sizeof(pointers) == sizeof(arrays));
  std::memcpy(&arrays, pointers, sizeof(arrays));
}

}  // namespace lightstage::sim
