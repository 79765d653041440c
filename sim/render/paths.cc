#include "sim/render/paths.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "sim/render/hash.h"
#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

#include "sim/render/bsdf.inc"

// A boundary of a medium is passed by so much. To meet it once more would do no harm: it is entered or left as before.
constexpr float kBeyond = 1e-6f;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
// From here on paths end by Russian roulette.
constexpr int kRouletteFrom = 3;
// No path passes through more boundaries of media between two vertices.
constexpr uint32_t kMostCrossings = 1000;

// The points of all pixels in all pairs of dimensions: the R2 sequence (Roberts 2018), shifted and in one of many orders, so that no
// two pairs of dimensions go together.
class Points {
 public:
  // Of the unit square.
  struct Point {
    float u, v;
  };

  explicit Points(int samples) : samples_(static_cast<uint32_t>(samples)) {
    orders_.reserve(kOrders * size_t{samples_});
    for (uint64_t order = 0; order < kOrders; ++order) {
      for (uint32_t i = 0; i < samples_; ++i) {
        orders_.push_back(static_cast<uint16_t>(Permute(i, samples_, Mix(order))));
      }
    }
  }

  Point At(uint64_t pixel, uint32_t dimension, uint32_t sample) const {
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

constexpr uint32_t kNone = 0xffffffffu;

static_assert(sizeof(VertexPacket) == kVertexFloats * sizeof(Lanes));

// Vertices in packets as the kernels make them. Lanes that hold none are left out.
class Vertices {
 public:
  void Clear() {
    pixels_.clear();
    free_ = 0;
  }
  // For eight vertices at once: the first one's number. They hold anything, and do not count before they are given a pixel.
  uint32_t AddPacket() {
    const auto first = static_cast<uint32_t>(pixels_.size());
    if (packets_.size() == first / kLanes) packets_.emplace_back();
    pixels_.resize(first + kLanes, kNone);
    return first;
  }
  VertexPacket& PacketOf(uint32_t vertex) { return packets_[vertex / kLanes]; }
  void SetPixel(uint32_t vertex, uint32_t x) { pixels_[vertex] = x; }
  // A single one, all 0.
  uint32_t Add(uint32_t x) {
    if (free_ % kLanes == 0) {
      free_ = AddPacket();
      PacketOf(free_) = {};
    }
    SetPixel(free_, x);
    return free_++;
  }
  // Into arrays, in order of the block's pixels.
  void Store(Slabs* slabs, Paths::Block* block);

 private:
  std::vector<VertexPacket> packets_;  // and what is left of earlier blocks
  std::vector<uint32_t> pixels_;       // per lane
  uint32_t free_ = 0;  // the next lane for a single one; none if it would begin a packet
  std::vector<uint32_t> order_;
  struct Run {
    uint32_t lane, count;  // within a packet
  };
  std::vector<Run> runs_;
  std::vector<float> arrays_;
};

// A path on its way. Its ray is in a packet.
struct Path {
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
  uint32_t crossings = 0;  // how many
};

// Paths that are as far: ray i is lane i % kLanes of packet i / kLanes.
struct Wave {
  std::vector<RTCRayHit8> packets;  // and what is left of earlier waves
  std::vector<Path> paths;

  size_t packet_count() const { return (paths.size() + kLanes - 1) / kLanes; }
  // What is nearer than `near` is not met.
  void Add(const Path& path, const Vec3f& origin, const Vec3f& direction, float near = 0) {
    const size_t packet = paths.size() / kLanes, k = paths.size() % kLanes;
    if (k == 0) {
      if (packets.size() == packet) packets.emplace_back();
      RTCHit8& hit = packets[packet].hit;
      std::fill_n(hit.geomID, kLanes, RTC_INVALID_GEOMETRY_ID);
      std::fill_n(hit.instID[0], kLanes, RTC_INVALID_GEOMETRY_ID);
    }
    RTCRay8& ray = packets[packet].ray;
    ray.org_x[k] = origin.x();
    ray.org_y[k] = origin.y();
    ray.org_z[k] = origin.z();
    ray.dir_x[k] = direction.x();
    ray.dir_y[k] = direction.y();
    ray.dir_z[k] = direction.z();
    ray.tnear[k] = near;
    ray.tfar[k] = kInfinity;
    ray.mask[k] = ~0u;
    paths.push_back(path);
  }
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
  Vec3f Direction(float x, float y) const {
    const Vec3f direction = corner + x * right + y * down;
    return (1 / direction.norm()) * direction;
  }

  int width;
  Vec3f origin, corner, right, down;
};

// What tracing a block needs, kept from block to block: its memory is touched already.
struct Scratch {
  Wave wave, next;
  Scene::Hits hits;
  SamplePacket samples = {};
  Vertices vertices;
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
        wave_(scratch->wave),
        next_(scratch->next),
        hits_(scratch->hits),
        samples_(scratch->samples),
        vertices_(scratch->vertices) {}

  void Trace(const Paths::Block& block) {
    Begin(block);
    while (!wave_.paths.empty()) {
      Intersect();
      next_.paths.clear();
      for (size_t i = 0; i < wave_.packet_count(); ++i) Arrive(i);
      std::swap(wave_, next_);
    }
  }

 private:
  Points::Point PointOf(const Path& path, uint32_t dimension) const {
    return points_.At(path.key, dimension, path.sample);
  }

  void Begin(const Paths::Block& block) {
    wave_.paths.clear();
    vertices_.Clear();
    for (int x = block.x; x < block.x + block.width; ++x) {
      Path path{.throughput = Rgb::Ones(), .x = static_cast<uint32_t>(x)};
      path.key = Fold(Fold(options_.seed, uint64_t{0x66696c6d}),
                      static_cast<uint64_t>(block.y) * film_.width + x);
      for (; path.sample < static_cast<uint32_t>(options_.samples); ++path.sample) {
        const Points::Point p = PointOf(path, kPixelDimension);
        wave_.Add(path, film_.origin,
                  film_.Direction(static_cast<float>(x) + p.u, static_cast<float>(block.y) + p.v));
      }
    }
  }

  void Intersect() {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = wave_.paths.front().depth == 0 ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                                   : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    for (size_t i = 0; i < wave_.packet_count(); ++i) {
      alignas(32) int valid[kLanes];
      for (size_t k = 0; k < kLanes; ++k) valid[k] = i * kLanes + k < wave_.paths.size() ? -1 : 0;
      rtcIntersect8(valid, scene_.handle(), &context, &wave_.packets[i]);
    }
  }

  // The rays of a packet have met something, or nothing.
  void Arrive(size_t packet) {
    const RTCRayHit8& rays = wave_.packets[packet];
    const Path* const paths = &wave_.paths[packet * kLanes];
    const int count =
        static_cast<int>(std::min<size_t>(kLanes, wave_.paths.size() - packet * kLanes));
    scene_.Resolve(rays, &hits_);
    int lanes[kLanes], scattered = 0;
    for (int k = 0; k < count; ++k) {
      if (EndsOnSurface(paths[k], rays.ray, k)) lanes[scattered++] = k;
    }
    if (scattered > 0) Scatter(paths, rays, {lanes, static_cast<size_t>(scattered)});
  }

  // True if the path is to be scattered by a surface; all else that it may come to is done here.
  bool EndsOnSurface(const Path& path, const RTCRay8& ray, int k) {
    const Material* const material = hits_.materials[k];
    const bool outside = hits_.surface.side.v[k] > 0;
    float length = material != nullptr ? ray.tfar[k] : kInfinity;
    bool scattered = false;
    // A medium is closed: where nothing comes, or its outer side, its end was too thin to be met.
    if (path.medium != nullptr && material != nullptr && !(material == path.medium && outside)) {
      const float u = PointOf(path, Dimension(path.depth, kDistance) + (path.crossings << 16)).u;
      const float free = -std::log(1 - u) / path.medium->extinction;
      scattered = free < length;
      length = std::min(free, length);
    }
    const Vec3f direction(ray.dir_x[k], ray.dir_y[k], ray.dir_z[k]);
    if (material != nullptr && !scattered && material->kind == Material::Kind::kMedium &&
        path.crossings < kMostCrossings) {
      Cross(path, direction, k, length);
      return false;
    }
    const float reach = path.travelled + length;
    const Vec3f origin(ray.org_x[k], ray.org_y[k], ray.org_z[k]);
    if (path.vertex != kNone) {
      vertices_.PacketOf(path.vertex).reach.v[path.vertex % kLanes] = reach;
    } else if (material == nullptr || !Clear(origin + length * direction)) {
      KeepOrigin(path, origin - path.travelled * direction, direction, path.throughput, reach);
    }
    if (material == nullptr || path.last) return false;
    if (scattered) {
      ScatterInMedium(path, origin + length * direction, direction);
      return false;
    }
    switch (material->kind) {
      case Material::Kind::kSurface:
        return true;
      case Material::Kind::kMirror:
        Mirror(path, direction, k);
        break;
      case Material::Kind::kGlass:
        Glass(path, direction, k);
        break;
      case Material::Kind::kMedium:
        break;
    }
    return false;
  }

  Vec3f PointAt(int k) const {
    const SurfacePacket& s = hits_.surface;
    return {s.x.v[k], s.y.v[k], s.z.v[k]};
  }
  Vec3f FaceAt(int k) const {
    const SurfacePacket& s = hits_.surface;
    return {s.fx.v[k], s.fy.v[k], s.fz.v[k]};
  }
  Vec3f NormalAt(int k) const {
    const SurfacePacket& s = hits_.surface;
    return {s.nx.v[k], s.ny.v[k], s.nz.v[k]};
  }

  // On through the boundary of a medium, still on the way from the same vertex.
  void Cross(const Path& path, const Vec3f& direction, int k, float length) {
    Path on = path;
    on.medium = hits_.surface.side.v[k] > 0 ? hits_.materials[k] : nullptr;
    on.travelled += length;
    ++on.crossings;
    next_.Add(on, PointAt(k), direction, kBeyond);
  }

  void ScatterInMedium(const Path& path, const Vec3f& point, const Vec3f& direction) {
    const Material& medium = *path.medium;
    const uint32_t vertex = vertices_.Add(path.x), k = vertex % kLanes;
    VertexPacket& v = vertices_.PacketOf(vertex);
    Put(point, k, &v.x, &v.y, &v.z);
    v.medium.v[k] = 1;
    Put(-direction, k, &v.vx, &v.vy, &v.vz);
    Put(path.throughput, k, &v.tr, &v.tg, &v.tb);
    Rgb albedo = medium.diffuse;
    if (medium.texture) albedo *= medium.texture({.position = point});
    Put(albedo, k, &v.dr, &v.dg, &v.db);
    v.roughness.v[k] = medium.anisotropy;
    const Points::Point disc_point = PointOf(path, Dimension(path.depth, kDisc));
    const CirclePoint disc = InDisc(disc_point.u, disc_point.v);
    v.disc_x.v[k] = disc.x;
    v.disc_y.v[k] = disc.y;
    if (path.depth < options_.bounces) {
      const Points::Point p = PointOf(path, Dimension(path.depth, kDirection));
      const float cosine = ScatteringCosine(medium.anisotropy, p.u);
      const CirclePoint around = OnCircle(p.v);
      const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
      const Vec3f across = direction.unitOrthogonal();
      const Vec3f next =
          sine * around.x * across + sine * around.y * direction.cross(across) + cosine * direction;
      Put(next.normalized(), k, &v.wx, &v.wy, &v.wz);
      Put(path.throughput * albedo, k, &v.fr, &v.fg, &v.fb);
    }
    GoOn(path, vertex);
  }

  // True if no light can be met by a ray from the camera that ends there: lights shine inwards, so only a ray on its way out meets
  // one, and such a ray does not end farther in.
  bool Clear(const Vec3f& end) const { return end.norm() < options_.clear_radius; }

  // A vertex that only passes on what its next ray meets.
  uint32_t KeepOrigin(const Path& path, const Vec3f& position, const Vec3f& direction,
                      const Rgb& throughput, float reach = 0) {
    const uint32_t vertex = vertices_.Add(path.x), k = vertex % kLanes;
    VertexPacket& v = vertices_.PacketOf(vertex);
    Put(position, k, &v.x, &v.y, &v.z);
    Put(-direction, k, &v.vx, &v.vy, &v.vz);
    Put(direction, k, &v.wx, &v.wy, &v.wz);
    Put(throughput, k, &v.fr, &v.fg, &v.fb);
    v.pdf.v[k] = 1;
    v.reach.v[k] = reach;
    return vertex;
  }

  void Scatter(const Path* paths, const RTCRayHit8& rays, std::span<const int> lanes) {
    for (int k : lanes) {
      const Path& path = paths[k];
      Put(path.throughput, k, &samples_.tr, &samples_.tg, &samples_.tb);
      const Points::Point disc = PointOf(path, Dimension(path.depth, kDisc));
      samples_.disc_u.v[k] = disc.u;
      samples_.disc_v.v[k] = disc.v;
      const bool on = path.depth < options_.bounces;
      samples_.on.v[k] = on ? 1 : 0;
      if (!on && hits_.surface.roughness.v[k] >= kGlossy) continue;
      const Points::Point next = PointOf(path, Dimension(path.depth, kDirection));
      samples_.u.v[k] = next.u;
      samples_.v.v[k] = next.v;
      samples_.choice.v[k] = PointOf(path, Dimension(path.depth, kChoice)).u;
    }
    const uint32_t first = vertices_.AddPacket();
    BestKernels().surface(rays, hits_.surface, samples_, &vertices_.PacketOf(first));
    for (int k : lanes) {
      vertices_.SetPixel(first + k, paths[k].x);
      GoOn(paths[k], first + k);
    }
  }

  void Mirror(const Path& path, const Vec3f& d, int k) {
    const SurfacePacket& s = hits_.surface;
    const Vec3f normal = NormalAt(k), face = FaceAt(k);
    const Vec3f direction = d - 2 * d.dot(normal) * normal;
    if (face.dot(direction) <= 0) return;
    const Rgb reflectance(s.sr.v[k], s.sg.v[k], s.sb.v[k]);
    GoOn(path, KeepOrigin(path, PointAt(k) + kLift * face, direction.normalized(),
                          path.throughput * reflectance));
  }

  void Glass(const Path& path, const Vec3f& d, int k) {
    const float ior = hits_.materials[k]->ior;
    const bool outside = hits_.surface.side.v[k] > 0;
    const Vec3f normal = NormalAt(k), face = FaceAt(k);
    const float n1 = outside ? 1 : ior, n2 = outside ? ior : 1;
    const float cosine = std::min(-d.dot(normal), 1.0f);
    if (cosine <= 0) return;
    float other = 0;
    const float reflectance = Fresnel(cosine, n1, n2, &other);
    Vec3f direction, position = PointAt(k);
    Rgb throughput = path.throughput;
    float narrowing = 1;
    if (PointOf(path, Dimension(path.depth, kChoice)).u < reflectance) {
      direction = d + 2 * cosine * normal;
      position += kLift * face;
    } else {
      const float ratio = n1 / n2;
      direction = ratio * d + (ratio * cosine - other) * normal;
      position -= kLift * face;
      narrowing = ratio * ratio;  // radiance is narrowed on its way into the denser side
      throughput *= narrowing * hits_.tints[k];
    }
    GoOn(path, KeepOrigin(path, position, direction.normalized(), throughput), narrowing);
  }

  // Sends the path along the next ray of `vertex`, if it is to have one.
  void GoOn(const Path& path, uint32_t vertex, float narrowing = 1) {
    const VertexPacket& v = vertices_.PacketOf(vertex);
    const uint32_t k = vertex % kLanes;
    const Rgb throughput(v.fr.v[k], v.fg.v[k], v.fb.v[k]);
    if (throughput.maxCoeff() <= 0) return;
    Path on = path;
    on.throughput = throughput;
    on.narrowed *= narrowing;
    on.last = path.depth >= options_.bounces;
    if (!on.last && path.depth >= kRouletteFrom) {
      const float survival = std::clamp(on.throughput.maxCoeff() / on.narrowed, 0.05f, 1.0f);
      on.last = PointOf(path, Dimension(path.depth, kRoulette)).u >= survival;
      on.throughput /= survival;
    }
    if (on.last && v.pdf.v[k] == 0) return;
    ++on.depth;
    on.vertex = vertex;
    on.travelled = 0;
    on.crossings = 0;
    next_.Add(on, {v.x.v[k], v.y.v[k], v.z.v[k]}, {v.wx.v[k], v.wy.v[k], v.wz.v[k]});
  }

  const Scene& scene_;
  const Film& film_;
  const Points& points_;
  const PathOptions& options_;
  Wave &wave_, &next_;
  Scene::Hits& hits_;
  SamplePacket& samples_;
  Vertices& vertices_;
};

// Arrays that are 0 or 1 throughout are not stored: of these there is one for all, as long as most blocks.
constexpr size_t kMostShared = 4096;
struct alignas(Slabs::kAlignment) Constant {
  explicit Constant(float value) { std::fill_n(v, kMostShared, value); }
  float v[kMostShared];
};
const Constant kZeros(0), kOnes(1);

// The one that is equal to the array, or null.
const float* Shared(const float* array, size_t count) {
  if (array[0] != 0 && array[0] != 1) return nullptr;
  const float* const shared = array[0] == 0 ? kZeros.v : kOnes.v;
  return std::memcmp(array, shared, count * sizeof(float)) == 0 ? shared : nullptr;
}

void Vertices::Store(Slabs* slabs, Paths::Block* block) {
  std::vector<uint32_t>& first = block->first;
  first.assign(static_cast<size_t>(block->width) + 1, 0);
  for (uint32_t x : pixels_) {
    if (x != kNone) ++first[x - block->x + 1];
  }
  for (int x = 0; x < block->width; ++x) first[x + 1] += first[x];
  const size_t vertices = first.back();
  if (vertices == 0) return;
  // Which lanes come when.
  order_.resize(vertices);
  for (size_t i = 0; i < pixels_.size(); ++i) {
    if (pixels_[i] != kNone) order_[first[pixels_[i] - block->x]++] = static_cast<uint32_t>(i);
  }
  std::rotate(first.begin(), first.end() - 1, first.end());  // they have moved on by one pixel
  first.front() = 0;
  // Most come together with their neighbours.
  runs_.clear();
  for (uint32_t lane : order_) {
    if (!runs_.empty() && lane % kLanes != 0 && lane == runs_.back().lane + runs_.back().count) {
      ++runs_.back().count;
    } else {
      runs_.push_back({lane, 1});
    }
  }

  block->count = (vertices + kLanes - 1) / kLanes * kLanes;
  // A cache line more apart than they are long: at multiples of a page all arrays would share a few places in the cache.
  const size_t apart = block->count + Slabs::kAlignment / sizeof(float);
  arrays_.resize(apart * kVertexFloats);
  const float* shared[kVertexFloats];
  size_t kept = 0;
  for (int k = 0; k < kVertexFloats; ++k) {
    float* const array = &arrays_[kept * apart];
    float* to = array;
    for (const Run& run : runs_) {
      const Lanes& from = reinterpret_cast<const Lanes*>(&packets_[run.lane / kLanes])[k];
      if (run.lane % kLanes == 0) {
        // Always a whole packet: what is too much is written over.
        std::memcpy(to, from.v, sizeof(from));
      } else {
        std::copy_n(from.v + run.lane % kLanes, run.count, to);
      }
      to += run.count;
    }
    std::fill(to, array + block->count, 0.0f);
    shared[k] = block->count <= kMostShared ? Shared(array, vertices) : nullptr;
    if (shared[k] == nullptr) ++kept;
  }
  const float* data = nullptr;
  if (kept > 0)
    data = static_cast<const float*>(
        std::memcpy(slabs->Take(kept * apart), arrays_.data(), kept * apart * sizeof(float)));
  const float* pointers[kVertexFloats];
  for (int k = 0; k < kVertexFloats; ++k) {
    pointers[k] = shared[k] != nullptr ? shared[k] : std::exchange(data, data + apart);
  }
  static_assert(sizeof(pointers) == sizeof(block->arrays));
  std::memcpy(&block->arrays, pointers, sizeof(pointers));
}

}  // namespace

size_t EstimatePathBytes(const Scene& scene, const CameraGeometry& camera, int width, int height,
                         const PathOptions& options) {
  // How many vertices paths have depends on the scene: a few are traced, of a picture with the same sides to one another.
  constexpr int kFew = 432;
  const auto across = static_cast<int>(std::clamp(
      std::lround(std::sqrt(static_cast<double>(kFew) * width / height)), 1L, long{kFew}));
  const int down = std::max(kFew / across, 1);
  PathOptions one = options;
  one.samples = 1;
  const Paths paths(scene, camera, across, down, one);
  double vertices = 0;
  for (const Paths::Block& block : paths.blocks()) vertices += block.first.back();
  const double per_path = vertices / (across * down) * kVertexFloats * sizeof(float);
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
    Tracer(scene, film, points, options, &scratch).Trace(blocks_[i]);
    scratch.vertices.Store(&slabs_, &blocks_[i]);
  });
}

}  // namespace lightstage::sim
