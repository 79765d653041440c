#include "sim/render/paths.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
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
constexpr float kInfinity = std::numeric_limits<float>::infinity();
// Glossier layers take what their next ray meets; on rougher ones connecting the light is good enough, and saves that ray.
constexpr float kGlossy = 0.25f;
// From here on paths end by Russian roulette.
constexpr int kRouletteFrom = 3;
// No path passes through more boundaries of media between two vertices.
constexpr uint32_t kMostCrossings = 1000;

struct Point2 {
  float x, y;
};

// The points of all pixels in all pairs of dimensions: the R2 sequence (Roberts 2018), shifted and in one of many orders, so that no
// two pairs of dimensions go together.
class Points {
 public:
  explicit Points(int samples) : samples_(static_cast<uint32_t>(samples)) {
    orders_.reserve(kOrders * size_t{samples_});
    for (uint64_t order = 0; order < kOrders; ++order) {
      for (uint32_t i = 0; i < samples_; ++i) {
        orders_.push_back(static_cast<uint16_t>(Permute(i, samples_, Mix(order))));
      }
    }
  }

  Point2 At(uint64_t pixel, uint32_t dimension, uint32_t sample) const {
    const uint64_t hash = Mix(pixel + dimension * 0x9e3779b97f4a7c15u);
    const uint32_t i = orders_[(hash % kOrders) * samples_ + sample];
    // In units of 2⁻³², where what goes beyond 1 falls away.
    return {Unit(static_cast<uint32_t>(hash >> 32) + i * 3242174889u),
            Unit(static_cast<uint32_t>(hash) + i * 2447445414u)};
  }

 private:
  static constexpr uint64_t kOrders = 64;
  static float Unit(uint32_t x) { return static_cast<float>(x >> 8) * 0x1p-24f; }

  const uint32_t samples_;
  std::vector<uint16_t> orders_;
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

constexpr uint32_t kNone = 0xffffffffu;

// A path that goes on: its ray.
struct Path {
  Vec3f origin, direction;
  Rgb throughput;
  uint64_t key = 0;  // of its pixel, for its points
  uint32_t x = 0, sample = 0;
  int depth = 0;            // of the vertex that the ray goes to
  bool last = false;        // only to learn how far the ray goes
  uint32_t vertex = kNone;  // that the ray comes from; kNone: the camera, and nothing is kept of it
  const Material* medium = nullptr;  // that it goes through
  // Part of the throughput that glass takes on entering and gives back on leaving.
  float narrowed = 1;
  float travelled = 0;     // from the vertex to the ray's origin: boundaries of media were passed
  uint32_t crossings = 0;  // how many …
  float near = 0;          // … and then the ray must not meet the last one again
};

// The camera's film: where the rays of its pixels go.
struct Film {
  Film(const CameraGeometry& camera, int columns, int rows) : width(columns) {
    const ViewFrame frame = CameraFrame(camera);
    const double step = 2 * std::tan(camera.field_of_view.radians() / 2) / columns;
    origin = frame.position.cast<float>();
    corner = (frame.forward - step / 2 * (columns * frame.right + rows * frame.down)).cast<float>();
    right = (step * frame.right).cast<float>();
    down = (step * frame.down).cast<float>();
  }
  // Unit; x and y in pixels.
  Vec3f Direction(float x, float y) const { return (corner + x * right + y * down).normalized(); }

  int width;
  Vec3f origin, corner, right, down;
};

// What tracing a block needs, kept from block to block: its memory is touched already.
struct Scratch {
  std::vector<Path> paths, going;
  std::vector<RTCRayHit8> hits;
  std::vector<Vertex> vertices;
  std::vector<uint32_t> pixels;
};

// About so many paths are a block.
constexpr int kBlock = 256;

class Tracer {
 public:
  Tracer(const Scene& scene, const Film& film, const Points& points, const PathOptions& options,
         Scratch* scratch)
      : scene_(scene),
        film_(film),
        points_(points),
        options_(options),
        paths_(scratch->paths),
        going_(scratch->going),
        hits_(scratch->hits),
        vertices_(scratch->vertices),
        pixels_(scratch->pixels) {}

  void Trace(const Paths::Block& block) {
    Begin(block);
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
  Point2 PointOf(const Path& path, uint32_t dimension) const {
    return points_.At(path.key, dimension, path.sample);
  }

  void Begin(const Paths::Block& block) {
    paths_.clear();
    vertices_.clear();
    pixels_.clear();
    for (int x = block.x; x < block.x + block.width; ++x) {
      Path path{.origin = film_.origin, .throughput = Rgb::Ones(), .x = static_cast<uint32_t>(x)};
      path.key = Fold(Fold(options_.seed, uint64_t{0x66696c6d}),
                      static_cast<uint64_t>(block.y) * film_.width + x);
      for (; path.sample < static_cast<uint32_t>(options_.samples); ++path.sample) {
        const Point2 p = PointOf(path, kPixelDimension);
        path.direction =
            film_.Direction(static_cast<float>(x) + p.x, static_cast<float>(block.y) + p.y);
        paths_.push_back(path);
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
      const float u = PointOf(path, Dimension(path.depth, kDistance) + (path.crossings << 16)).x;
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
    Vertex v;
    v.position = point;
    v.medium = 1;
    v.view = -path.direction;
    v.throughput = path.throughput;
    v.diffuse = path.medium->diffuse;
    if (path.medium->texture) v.diffuse *= path.medium->texture({.position = point});
    v.roughness = path.medium->anisotropy;
    const Point2 disc = InDisc(PointOf(path, Dimension(path.depth, kDisc)));
    v.disc_x = disc.x;
    v.disc_y = disc.y;
    if (path.depth < options_.bounces) {
      const Point2 u = PointOf(path, Dimension(path.depth, kDirection));
      const float cosine = ScatteringCosine(v.roughness, u.x);
      const Point2 around = OnCircle(u.y);
      const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
      v.next =
          Frame3(path.direction).ToWorld({sine * around.x, sine * around.y, cosine}).normalized();
      v.behind = v.throughput * v.diffuse;
    }
    GoOn(path, Keep(v, path.x));
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
    const Point2 disc = InDisc(PointOf(path, Dimension(depth, kDisc)));
    v.disc_x = disc.x;
    v.disc_y = disc.y;

    const bool on = depth < options_.bounces;
    if (!on && v.mis == 0) {
      Keep(v, path.x);
      return;
    }
    const Point2 u = PointOf(path, Dimension(depth, kDirection));
    const Frame3 frame(v.normal);
    if (PointOf(path, Dimension(depth, kChoice)).x < v.share) {
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
    GoOn(path, Keep(v, path.x));
  }

  void Mirror(const Path& path, const Scene::Hit& hit) {
    const Vec3f& d = path.direction;
    const Vec3f direction = d - 2 * d.dot(hit.normal) * hit.normal;
    if (hit.face.dot(direction) <= 0) return;
    const uint32_t vertex = Keep(Origin(hit.point + kLift * hit.face, direction.normalized(),
                                        path.throughput * hit.specular),
                                 path.x);
    GoOn(path, vertex);
  }

  void Glass(const Path& path, const Scene::Hit& hit) {
    const Vec3f& d = path.direction;
    const float n1 = hit.outside ? 1 : hit.material->ior, n2 = hit.outside ? hit.material->ior : 1;
    const float cosine = std::min(-d.dot(hit.normal), 1.0f);
    if (cosine <= 0) return;
    float other = 0;
    const float reflectance = Fresnel(cosine, n1, n2, &other);
    Vec3f direction, position = hit.point;
    Rgb throughput = path.throughput;
    float narrowing = 1;
    if (PointOf(path, Dimension(path.depth, kChoice)).x < reflectance) {
      direction = d + 2 * cosine * hit.normal;
      position += kLift * hit.face;
    } else {
      const float ratio = n1 / n2;
      direction = ratio * d + (ratio * cosine - other) * hit.normal;
      position -= kLift * hit.face;
      narrowing = ratio * ratio;  // radiance is narrowed on its way into the denser side
      throughput *= narrowing * hit.tint;
    }
    GoOn(path, Keep(Origin(position, direction.normalized(), throughput), path.x), narrowing);
  }

  // Sends the path along the next ray of `vertex`, if it is to have one.
  void GoOn(const Path& path, uint32_t vertex, float narrowing = 1) {
    const Vertex& v = vertices_[vertex];
    Rgb throughput = v.behind;
    if (!(throughput > 0).any()) return;
    bool last = path.depth >= options_.bounces;
    if (!last && path.depth >= kRouletteFrom) {
      const float survival =
          std::clamp(throughput.maxCoeff() / (path.narrowed * narrowing), 0.05f, 1.0f);
      if (PointOf(path, Dimension(path.depth, kRoulette)).x >= survival) last = true;
      throughput /= survival;
    }
    if (last && v.pdf == 0) return;
    going_.push_back({.origin = v.position,
                      .direction = v.next,
                      .throughput = throughput,
                      .key = path.key,
                      .x = path.x,
                      .sample = path.sample,
                      .depth = path.depth + 1,
                      .last = last,
                      .vertex = vertex,
                      .medium = path.medium,
                      .narrowed = path.narrowed * narrowing});
  }

  const Scene& scene_;
  const Film& film_;
  const Points& points_;
  const PathOptions& options_;
  std::vector<Path>&paths_, &going_;
  std::vector<RTCRayHit8>& hits_;
  std::vector<Vertex>& vertices_;
  std::vector<uint32_t>& pixels_;
};

// Arrays that are 0 or 1 throughout are not stored: of these there is one for all, as long as most blocks.
constexpr size_t kMostShared = 4096;
struct alignas(Slabs::kAlignment) Constant {
  explicit Constant(float value) { std::fill_n(v, kMostShared, value); }
  float v[kMostShared];
};
const Constant kZeros(0), kOnes(1);

// Puts the vertices in order of their pixels and into arrays.
void Fill(const std::vector<uint32_t>& pixels, const std::vector<Vertex>& vertices, Slabs* slabs,
          Paths::Block* block) {
  std::vector<uint32_t>& first = block->first;
  first.assign(static_cast<size_t>(block->width) + 1, 0);
  for (uint32_t x : pixels) ++first[x - block->x + 1];
  for (int x = 0; x < block->width; ++x) first[x + 1] += first[x];
  const size_t count = (pixels.size() + kLanes - 1) / kLanes * kLanes;
  block->count = count;
  if (count == 0) return;

  const auto* const values = reinterpret_cast<const float*>(vertices.data());
  std::array<bool, kVertexFloats> varies;
  varies.fill(count > kMostShared);
  for (size_t i = 1; i < vertices.size(); ++i) {
    for (int k = 0; k < kVertexFloats; ++k) varies[k] |= values[i * kVertexFloats + k] != values[k];
  }
  std::array<int, kVertexFloats> stored;
  size_t arrays = 0;
  for (int k = 0; k < kVertexFloats; ++k) {
    if (varies[k] || (values[k] != 0 && values[k] != 1)) stored[arrays++] = k;
  }
  // A cache line more apart than they are long: at multiples of a page all arrays would share a few places in the cache.
  const size_t apart = count + Slabs::kAlignment / sizeof(float);
  float* const data = slabs->Take(apart * arrays);
  std::vector<uint32_t> next(first.begin(), first.end() - 1);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const uint32_t to = next[pixels[i] - block->x]++;
    for (size_t a = 0; a < arrays; ++a)
      data[a * apart + to] = values[i * kVertexFloats + stored[a]];
  }

  const float* pointers[kVertexFloats];
  for (int k = 0; k < kVertexFloats; ++k) pointers[k] = values[k] == 0 ? kZeros.v : kOnes.v;
  for (size_t a = 0; a < arrays; ++a) {
    float* const array = data + a * apart;
    std::fill(array + pixels.size(), array + count, 0.0f);
    pointers[stored[a]] = array;
  }
  static_assert(sizeof(pointers) == sizeof(block->arrays));
  std::memcpy(&block->arrays, pointers, sizeof(pointers));
}

}  // namespace

size_t EstimatePathBytes(const Scene& scene, const CameraGeometry& camera, int width, int height,
                         const PathOptions& options) {
  // How many vertices paths have depends on the scene: a few are traced.
  constexpr int kAcross = 24, kDown = 18;
  PathOptions few = options;
  few.samples = 1;
  const Paths paths(scene, camera, kAcross, kDown, few);
  double vertices = 0;
  for (const Paths::Block& block : paths.blocks()) vertices += block.first.back();
  const double per_path = vertices / (kAcross * kDown) * kVertexFloats * sizeof(float);
  return static_cast<size_t>(per_path * width * height * options.samples);
}

Paths::Paths(const Scene& scene, const CameraGeometry& camera, int width, int height,
             const PathOptions& options)
    : camera_(camera), width_(width), height_(height), samples_(options.samples) {
  const int most = std::max(1, kBlock / samples_);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; x += most) blocks_.push_back({x, y, std::min(most, width - x)});
  }
  const Film film(camera, width, height);
  const Points points(samples_);
  ForAll(static_cast<int>(blocks_.size()), [&](int i) {
    thread_local Scratch scratch;
    Tracer tracer(scene, film, points, options, &scratch);
    tracer.Trace(blocks_[i]);
    Fill(tracer.pixels(), tracer.vertices(), &slabs_, &blocks_[i]);
  });
}

}  // namespace lightstage::sim
