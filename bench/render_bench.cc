// The renderer against Embree alone, against itself on one core, and its pattern product against the memory it has to read.
//
// Rays: the very rays of a picture - from the camera, between surfaces, and to a lamp - are prepared in packets, and a bare loop of
// rtcIntersect8 and rtcOccluded8 over them on all cores is the peer. The renderer makes the same rays, samples and shades besides.
// Patterns: a triad over as much memory as the product reads and writes, on all cores, is the limit.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <limits>
#include <vector>

#include "base/status.h"
#include "optics/pattern.h"
#include "sim/render/illuminate.h"
#include "sim/render/parallel.h"
#include "sim/render/paths.h"
#include "sim/scenes/scenes.h"

namespace lightstage::sim {
namespace {

constexpr int kWidth = 640, kHeight = 480;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Seconds that each takes, the best of several runs: noise only adds. In turn, for the machine's speed drifts.
std::vector<double> Best(const std::vector<std::function<void()>>& bodies) {
  constexpr int kRuns = 9;
  std::vector<double> best(bodies.size(), 1e9);
  for (int run = 0; run < kRuns; ++run) {
    for (size_t i = 0; i < bodies.size(); ++i) {
      const auto start = std::chrono::steady_clock::now();
      bodies[i]();
      const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
      best[i] = std::min(best[i], time.count());
    }
  }
  return best;
}

// Rays in packets, by rows as the renderer has them.
class Rays {
 public:
  explicit Rays(int rows) : rows_(rows) {}
  void Add(int y, const float* origin, const float* direction, float length) {
    Row& row = rows_[y];
    const size_t k = row.count % kLanes;
    if (k == 0) {
      row.packets.emplace_back();
      for (int i = 0; i < kLanes; ++i)
        row.packets.back().tfar[i] = -kInfinity;  // lanes that stay empty
    }
    RTCRay8& ray = row.packets.back();
    ray.org_x[k] = origin[0], ray.org_y[k] = origin[1], ray.org_z[k] = origin[2];
    ray.dir_x[k] = direction[0], ray.dir_y[k] = direction[1], ray.dir_z[k] = direction[2];
    ray.tnear[k] = 0, ray.tfar[k] = length, ray.time[k] = 0, ray.mask[k] = ~0u, ray.id[k] = 0,
    ray.flags[k] = 0;
    ++row.count;
    ++count_;
  }
  size_t count() const { return count_; }

  void Intersect(RTCScene scene, RTCIntersectContextFlags flags) const {
    ForAll(static_cast<int>(rows_.size()), [&](int y) {
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      context.flags = flags;
      for (const RTCRay8& packet : rows_[y].packets) {
        alignas(32) int valid[kLanes];
        RTCRayHit8 ray;
        ray.ray = packet;
        for (int k = 0; k < kLanes; ++k) {
          valid[k] = packet.tfar[k] > 0 ? -1 : 0;
          ray.hit.geomID[k] = ray.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect8(valid, scene, &context, &ray);
      }
    });
  }
  void Occluded(RTCScene scene) const {
    ForAll(static_cast<int>(rows_.size()), [&](int y) {
      ShadowContext context{};
      rtcInitIntersectContext(&context.embree);
      context.embree.flags = RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
      for (const RTCRay8& packet : rows_[y].packets) {
        alignas(32) int valid[kLanes];
        RTCRay8 ray = packet;
        for (int k = 0; k < kLanes; ++k) valid[k] = packet.tfar[k] > 0 ? -1 : 0;
        rtcOccluded8(valid, scene, &context.embree, &ray);
      }
    });
  }

 private:
  struct Row {
    std::vector<RTCRay8> packets;
    size_t count = 0;
  };
  std::vector<Row> rows_;
  size_t count_ = 0;
};

struct AllRays {
  Rays camera{kHeight}, between{kHeight}, shadow{kHeight};
};

// What the renderer traced, from what it kept.
AllRays Collect(const Paths& paths, const DiscLight& light) {
  AllRays rays;
  const ViewFrame frame = CameraFrame(paths.camera());
  const double tan_x = std::tan(paths.camera().field_of_view.radians() / 2),
               tan_y = tan_x * kHeight / kWidth;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int s = 0; s < paths.samples(); ++s) {
        const double px = x + (s + 0.5) / paths.samples(), py = y + 0.5;
        const Eigen::Vector3f origin = frame.position.cast<float>(),
                              direction =
                                  (frame.forward + (px / kWidth * 2 - 1) * tan_x * frame.right +
                                   (py / kHeight * 2 - 1) * tan_y * frame.down)
                                      .normalized()
                                      .cast<float>();
        rays.camera.Add(y, origin.data(), direction.data(), kInfinity);
      }
    }
  }
  for (const Paths::Block& block : paths.blocks()) {
    const VertexArrays& v = block.arrays;
    const int y = block.y;
    for (size_t i = 0; i < block.count; ++i) {
      const float at[3] = {v.x[i], v.y[i], v.z[i]}, next[3] = {v.wx[i], v.wy[i], v.wz[i]};
      if (v.reach[i] > 0) rays.between.Add(y, at, next, kInfinity);
      float to[3], square = 0, here = 0, there = 0;
      const float normal[3] = {v.nx[i], v.ny[i], v.nz[i]};
      for (int c = 0; c < 3; ++c) {
        to[c] = light.center[c] + v.disc_x[i] * light.u[c] + v.disc_y[i] * light.v[c] - at[c];
        square += to[c] * to[c];
        here += normal[c] * to[c];
        there -= light.axis[c] * to[c];
      }
      if (here <= 0 || there <= 0) continue;
      const float length = std::sqrt(square),
                  unit[3] = {to[0] / length, to[1] / length, to[2] / length};
      rays.shadow.Add(y, at, unit, 0.9999f * length);
    }
  }
  return rays;
}

void BenchRays(const std::string& name, const RigGeometry& rig, int bounces) {
  auto description = LoadScene(name, "");
  auto scene = Scene::Build(*std::move(description));
  const PathOptions options{.samples = 8, .bounces = bounces, .clear_radius = 0.999f};
  const DiscLight light = LampLight(rig.brace, 0, Degrees(40), 10, 1);
  const Paths paths(*scene, rig.camera, kWidth, kHeight, options);
  const AllRays rays = Collect(paths, light);

  const auto trace = [&] { Paths again(*scene, rig.camera, kWidth, kHeight, options); };
  const auto connect = [&] { Illuminate(*scene, paths, light); };
  const auto one = [](const auto& body) {
    return [&body] {
      const ThreadLimit limit(1);
      body();
    };
  };
  const auto bare_trace = [&] {
    rays.camera.Intersect(scene->handle(), RTC_INTERSECT_CONTEXT_FLAG_COHERENT);
    rays.between.Intersect(scene->handle(), RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
  };
  const auto bare_connect = [&] { rays.shadow.Occluded(scene->handle()); };
  const std::vector<double> times = Best({trace, bare_trace, one(trace), one(bare_trace), connect,
                                          bare_connect, one(connect), one(bare_connect)});
  const double trace_s = times[0], bare_trace_s = times[1], one_trace_s = times[2],
               one_bare_trace_s = times[3], connect_s = times[4], bare_connect_s = times[5],
               one_connect_s = times[6], one_bare_connect_s = times[7];
  const double traced = static_cast<double>(rays.camera.count() + rays.between.count()),
               connected = static_cast<double>(rays.shadow.count());
  std::printf("%-12s %7d %8.1f %8.1f %7.2f %9.1f %8.1f %7.2f %7.2f %8.2f %8.2f\n", name.c_str(),
              bounces, traced / trace_s / 1e6, traced / bare_trace_s / 1e6, bare_trace_s / trace_s,
              connected / connect_s / 1e6, connected / bare_connect_s / 1e6,
              bare_connect_s / connect_s, (bare_trace_s + bare_connect_s) / (trace_s + connect_s),
              (one_trace_s + one_connect_s) / (trace_s + connect_s),
              (one_bare_trace_s + one_bare_connect_s) / (bare_trace_s + bare_connect_s));
}

void BenchPatterns(const RigGeometry& rig, int bounces) {
  auto description = LoadScene("default", "");
  auto scene = Scene::Build(*std::move(description));
  const Paths paths(*scene, rig.camera, kWidth, kHeight, {.samples = 8, .bounces = bounces});
  const LensLight light = ProjectorLight(rig.projector, {}, {Degrees(30), Degrees(40)}, 10, 1);
  const ProjectorTransport transport = Illuminate(*scene, paths, light);
  Image sum(kWidth, kHeight, 3);
  // The transport, once, and the pixels of the picture that it lights, read and written.
  transport.Add(Image(rig.projector.width, rig.projector.height, 1, 1.0f), 1.0f, &sum);
  const auto lit =
      std::count_if(sum.pixels().begin(), sum.pixels().end(), [](float v) { return v != 0; });
  const size_t bytes = transport.bytes() + 2 * sizeof(float) * lit;
  const size_t n = bytes / (3 * sizeof(float));
  std::vector<float> a(n, 1), b(n, 2), c(n, 3);
  constexpr int kParts = 64;
  const auto triad = [&] {
    ForAll(kParts, [&](int part) {
      for (size_t i = n * part / kParts; i < n * (part + 1) / kParts; ++i)
        a[i] = b[i] + 1.5f * c[i];
    });
  };
  for (const Pattern& pattern :
       {Pattern{PatternArrangement::kFull},
        Pattern{PatternArrangement::kSquare, PatternProfile::kGaussian, 16, 0, 7, 8},
        Pattern{PatternArrangement::kHorizontal, PatternProfile::kBox, 16, 2, 1, 3}}) {
    const Image raster = Rasterize(pattern, rig.projector.width, rig.projector.height);
    const std::vector<double> times = Best({[&] { transport.Add(raster, 1.0f, &sum); }, triad});
    std::printf("%-32s %7d %8.1f %9.2f %9.2f %7.2f\n", PatternName(pattern).c_str(), bounces,
                static_cast<double>(bytes) / 1e6, times[0] * 1e3, times[1] * 1e3,
                times[1] / times[0]);
  }
}

int Main(const std::vector<std::string>& scenes) {
  RigGeometry rig;
  rig.brace = {Meters(1), Meters(0.02), {{Degrees(0), Degrees(40)}}};
  rig.projector = {true, Meters(1.5), Degrees(0), Degrees(20), 1024, 768};
  rig.camera = {Vec3(0, -1.1, 0.55), Vec3(0, 0, 0.075), Degrees(17)};
  std::printf(
      "Mrays/s, renderer and bare Embree over the same rays (%s kernels), and the time of one core "
      "over that of all\n",
      BestKernels().name);
  std::printf("%-12s %7s %8s %8s %7s %9s %8s %7s %7s %8s %8s\n", "scene", "bounces", "trace",
              "bare", "ratio", "connect", "bare", "ratio", "both", "scaling", "bare");
  for (const std::string& scene : scenes) {
    for (int bounces : {0, 1}) BenchRays(scene, rig, bounces);
  }
  std::printf("\none pattern at a cached pose, %d x %d, against a triad over as much memory\n",
              kWidth, kHeight);
  std::printf("%-32s %7s %8s %9s %9s %7s\n", "pattern", "bounces", "MB", "ms", "triad ms", "ratio");
  for (int bounces : {0, 1}) BenchPatterns(rig, bounces);
  return 0;
}

}  // namespace
}  // namespace lightstage::sim

int main(int argc, char** argv) {
  const std::vector<std::string> scenes(argv + 1, argv + argc);
  return lightstage::sim::Main(scenes.empty() ? std::vector<std::string>{"default", "toys", "room"}
                                              : scenes);
}
