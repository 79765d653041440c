// Light against closed forms, and what everybody relies on: superposition, determinism, bounded memory.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <fstream>
#include <new>
#include <numbers>
#include <random>

#include "optics/pattern.h"
#include "sim/render/parallel.h"
#include "sim/render/shapes.h"
#include "sim/render/test_scene.h"
#include "sim/render/transport.h"

namespace lightstage::sim {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kIntensity = 10;

RigGeometry Rig(double lamp_radius_m = 0.02) {
  RigGeometry rig;
  rig.brace.radius = Meters(1);
  rig.brace.lamp_radius = Meters(lamp_radius_m);
  rig.brace.lamps = {
      {Degrees(0), Degrees(0)}, {Degrees(0), Degrees(60)}, {Degrees(180), Degrees(30)}};
  rig.projector = {true, Meters(1.5), Degrees(0), Degrees(30), 64, 48};
  rig.camera = {Vec3(0.2, -0.9, 0.8), Vec3::Zero(), Degrees(20)};
  return rig;
}

Scene GreyFloor(double albedo = 0.5) {
  return BuildScene({Floor(5, 0)}, {{.diffuse = Rgb::Constant(static_cast<float>(albedo))}});
}

// Something of everything, in the middle of the picture.
Scene StillLife() {
  const Mesh pillar = Box({0.05f, 0.02f, 0.06f}, {0.01f, 0.01f, 0.06f}, 0.3f);
  Mesh top = Floor(0.3f, 0), ball = Sphere({-0.04f, 0.01f, 0.05f}, 0.05f), post = pillar;
  ball.material = 1;
  post.material = 2;
  return BuildScene(
      {top, ball, post},
      {{.diffuse = Rgb(0.6f, 0.5f, 0.4f)},
       {.diffuse = Rgb(0.5f, 0.02f, 0.02f), .specular = Rgb::Constant(0.05f), .roughness = 0.1f},
       {.specular = Rgb(0.9f, 0.7f, 0.3f), .roughness = 0.2f}});
}

bool SameBytes(const Image& a, const Image& b) {
  return a.SameShape(b) &&
         std::memcmp(a.pixels().data(), b.pixels().data(), a.pixels().size_bytes()) == 0;
}

// A camera that looks at one point of the ground.
CameraGeometry Pinprick(const Vec3& at = Vec3::Zero()) {
  return {at + Vec3(0.3, -0.5, 1), at, Degrees(0.01)};
}

// A Lambertian disc of radius R whose axis meets a point at distance D gives it the irradiance I·cosθ / (R² + D²), I its intensity
// along the axis, as long as all of it is above the point's horizon (e.g. Howell's catalogue of configuration factors, B-13).
TEST(Lamp, IrradianceOfADiscIsTheClosedForm) {
  for (double radius : {0.02, 0.25}) {
    RigGeometry rig = Rig(radius);
    rig.camera = Pinprick();
    Transport transport(GreyFloor(0.5), rig, {.samples = 64, .lamp_intensity_w_sr = kIntensity});
    const double tilts[] = {0, 60, 30};
    for (int lamp = 0; lamp < 3; ++lamp) {
      double irradiance = kIntensity * std::cos(tilts[lamp] * kPi / 180) / (1 + radius * radius);
      double seen = Mean(*transport.Lamp({16, 16}, {Degrees(33)}, lamp, Keep::kNo));
      EXPECT_NEAR(seen / (0.5 / kPi * irradiance), 1, 0.002) << "lamp " << lamp << ", R " << radius;
    }
  }
}

// Where half of the disc hides behind a straight edge through its axis, half of the light is left.
TEST(Lamp, HalfHiddenGivesHalf) {
  RigGeometry rig = Rig(0.1);
  rig.camera = Pinprick();
  // Covers x > 0 half-way up.
  Mesh cover = Box({2.0f, 0, 0.5f}, {2.0f, 2.0f, 1e-4f});
  Transport open(GreyFloor(), rig, {.samples = 64});
  std::vector<Mesh> meshes = {Floor(5, 0), cover};
  double all = Mean(*open.Lamp({16, 16}, {Degrees(0)}, 0, Keep::kNo));
  // Seen from beside the cover, so that it does not hide the ground.
  rig.camera.position = Vec3(-0.3, -0.5, 0.3);
  Transport seen(BuildScene(meshes, {{.diffuse = Rgb::Constant(0.5f)}}), rig, {.samples = 64});
  EXPECT_NEAR(Mean(*seen.Lamp({16, 16}, {Degrees(0)}, 0, Keep::kNo)) / all, 0.5, 0.01);
}

TEST(Lamp, ShadowIsBlackAndLightBesideItIsFull) {
  RigGeometry rig = Rig(0.001);
  std::vector<Mesh> meshes = {Floor(5, 0), Box({0, 0, 0.5f}, {0.05f, 0.05f, 0.01f})};
  Scene scene = BuildScene(meshes, {{.diffuse = Rgb::Constant(0.5f)}});
  // The lamp in the zenith at 1 m throws a shadow of twice the box, ±0.1 m.
  rig.camera = Pinprick(Vec3(-0.08, 0, 0));
  Transport shadow(std::move(scene), rig, {});
  EXPECT_EQ(Mean(*shadow.Lamp({8, 8}, {Degrees(0)}, 0, Keep::kNo)), 0);
  rig.camera = Pinprick(Vec3(-0.15, 0, 0));
  Transport light(BuildScene(meshes, {{.diffuse = Rgb::Constant(0.5f)}}), rig, {});
  // At 0.15 m from the axis: cosine to both normals, distance² 1 + 0.15².
  double irradiance = kIntensity * std::pow(1 + 0.15 * 0.15, -2);
  EXPECT_NEAR(Mean(*light.Lamp({8, 8}, {Degrees(0)}, 0, Keep::kNo)) / (0.5 / kPi * irradiance), 1,
              1e-3);
}

// The reflectance of GGX at normal incidence and normal view is F0 / (4π α²).
TEST(Lamp, GlossyPeakIsTheClosedForm) {
  RigGeometry rig = Rig(0.001);
  rig.camera = {Vec3(0, 0, 0.8), Vec3::Zero(), Degrees(0.01)};
  const float alpha = 0.2f, f0 = 0.5f;
  Transport transport(
      BuildScene({Floor(5, 0)}, {{.specular = Rgb::Constant(f0), .roughness = alpha}}), rig, {});
  EXPECT_NEAR(Mean(*transport.Lamp({8, 8}, {Degrees(0)}, 0, Keep::kNo)) /
                  (kIntensity * f0 / (4 * kPi * alpha * alpha)),
              1, 1e-3);
}

// A smooth sphere is shaded by its own normals, not by its facets'.
TEST(Lamp, SphereFollowsLambert) {
  RigGeometry rig = Rig(0.001);
  const double radius = 0.1;
  const Vec3 normal = DirectionFromAngles(Degrees(300), Degrees(40));
  rig.camera = {2.0 * normal, radius * normal, Degrees(0.01)};
  Transport transport(
      BuildScene({Sphere(Vec3f::Zero(), 0.1f, 96)}, {{.diffuse = Rgb(0.9f, 0.6f, 0.3f)}}), rig, {});
  const Vec3 lamp = LampDirection(rig.brace.lamps[1], Degrees(75));
  const Vec3 way = lamp - radius * normal;
  // The lamp faces the origin, not quite this point.
  double irradiance =
      kIntensity * normal.dot(way.normalized()) * lamp.dot(way.normalized()) / way.squaredNorm();
  auto image = transport.Lamp({4, 4}, {Degrees(75)}, 1, Keep::kNo);
  for (int c = 0; c < 3; ++c) {
    const double albedo = c == 0 ? 0.9 : c == 1 ? 0.6 : 0.3;
    EXPECT_NEAR(image->at(2, 2, c) / (albedo / kPi * irradiance), 1, 5e-3) << "channel " << c;
  }
}

// The turntable turns object and camera: a lamp at azimuth φ with the table at α is a lamp at φ − α with the table at 0.
TEST(Lamp, OnlyTheDifferenceOfAnglesMatters) {
  RigGeometry rig = Rig();
  rig.brace.lamps = {{Degrees(50), Degrees(40)}, {Degrees(20), Degrees(40)}};
  Transport transport(StillLife(), rig, {.samples = 16});
  auto turned = transport.Lamp({64, 48}, {Degrees(30)}, 0, Keep::kNo);
  auto there = transport.Lamp({64, 48}, {Degrees(0)}, 1, Keep::kNo);
  double difference = 0;
  for (size_t i = 0; i < turned->pixels().size(); ++i) {
    difference += std::abs(turned->pixels()[i] - there->pixels()[i]);
  }
  EXPECT_GT(Mean(*there), 0.01);
  EXPECT_LT(difference / static_cast<double>(turned->pixels().size()), 0.02 * Mean(*there));
}

// An even wall: intensity / distance² wherever the projector reaches, nothing elsewhere.
TEST(Projector, LightsAWallEvenly) {
  RigGeometry rig = Rig();
  rig.camera = {Vec3(0, 0, 1), Vec3::Zero(), Degrees(70)};
  Transport transport(GreyFloor(0.5), rig, {.projector_intensity_w_sr = kIntensity});
  Image image(70, 70, 3);
  Image white(64, 48, 1, 1.0f);
  transport.Projector({70, 70}, {Degrees(0), Degrees(0)}, Keep::kNo)->Add(white, 1, &image);
  const double expected = 0.5 / kPi * kIntensity / (1.5 * 1.5);
  const double reach_x = 1.5 * std::tan(15 * kPi / 180), reach_y = reach_x * 48 / 64;
  int lit = 0;
  for (int y = 0; y < 70; ++y) {
    for (int x = 0; x < 70; ++x) {
      // The camera looks straight down with image-right along world ∓Y and image-down along −X; only |x|, |y| matter here.
      const double half = std::tan(35 * kPi / 180), pixel = 2 * half / 70;
      const double across = std::abs((x + 0.5) * pixel - half),
                   along = std::abs((y + 0.5) * pixel - half);
      const bool inside = across < reach_x - pixel && along < reach_y - pixel;
      const bool outside = across > reach_x + pixel || along > reach_y + pixel;
      if (inside) {
        EXPECT_NEAR(image.at(x, y, 0) / expected, 1, 1e-3) << x << ", " << y;
      }
      if (outside) {
        EXPECT_EQ(image.at(x, y, 0), 0) << x << ", " << y;
      }
      lit += inside;
    }
  }
  EXPECT_GT(lit, 500);
}

TEST(Projector, SquaresFallWhereTheGeometrySays) {
  RigGeometry rig = Rig();
  const Pose pose{Degrees(25), Degrees(50)};
  const ViewFrame frame = ProjectorFrame(rig.projector, pose);
  const double tan_x = std::tan(15 * kPi / 180), tan_y = tan_x * 48 / 64;
  for (GridSquare square : {GridSquare{0, 0}, GridSquare{3, 1}, GridSquare{2, 3}}) {
    const Vec3 ray = frame.forward + ((square.column + 0.5) / 2 - 1) * tan_x * frame.right +
                     ((square.row + 0.5) / 2 - 1) * tan_y * frame.down;
    const Vec3 ground = frame.position - frame.position.z() / ray.z() * ray;
    rig.camera = Pinprick(ground);
    Transport transport(GreyFloor(), rig, {});
    auto traced = transport.Projector({4, 4}, pose, Keep::kNo);
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) {
        Pattern pattern{PatternArrangement::kSquare, PatternProfile::kBox, 4, 0, column, row};
        Image image(4, 4, 3);
        traced->Add(Rasterize(pattern, 64, 48), 1, &image);
        const bool lit = GridSquare{column, row} == square;
        EXPECT_EQ(Mean(image) > 0, lit) << column << ", " << row;
      }
    }
  }
}

TEST(Projector, SquaresAddUpToFull) {
  Transport transport(StillLife(), Rig(), {});
  const FilmSize size{48, 36};
  auto traced = transport.Projector(size, {Degrees(10), Degrees(45)}, Keep::kYes);
  Image full(48, 36, 3);
  traced->Add(Rasterize({PatternArrangement::kFull}, 64, 48), 1, &full);
  EXPECT_GT(Mean(full), 0.01);
  for (PatternProfile profile :
       {PatternProfile::kBox, PatternProfile::kGaussian, PatternProfile::kHat}) {
    Image sum(48, 36, 3);
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 6; ++column) {
        traced->Add(Rasterize({PatternArrangement::kSquare, profile, 6, 0, column, row}, 64, 48), 1,
                    &sum);
      }
    }
    for (size_t i = 0; i < sum.pixels().size(); ++i) {
      ASSERT_NEAR(sum.pixels()[i], full.pixels()[i], 1e-5 * (1 + full.pixels()[i]));
    }
  }
}

TEST(ForAll, ThrowsWhatABodyThrows) {
  for (int threads : {1, 2, 5}) {
    ThreadLimit limit(threads);
    for (int round = 0; round < 200; ++round) {
      std::atomic<int> made{0};
      try {
        ForAll(100, [&](int i) {
          ++made;
          if (i % 7 == 3) throw std::bad_alloc();
        });
        ADD_FAILURE() << "nothing was thrown";
      } catch (const std::bad_alloc&) {
      }
      EXPECT_GT(made, 0);
      // The pool has forgotten it.
      std::atomic<int> sum{0};
      ForAll(100, [&](int i) { sum += i; });
      ASSERT_EQ(sum, 4950);
    }
  }
}

#ifndef LIGHTSTAGE_SANITIZED
// In a process of its own, whose pool is made when there is no room for a thread's stack.
TEST(ForAllDeathTest, WorksWhereNoThreadCanBeStarted) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  auto work = [] {
    long pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlim_t most = static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) +
                        (rlim_t{1} << 20);
    const rlimit space{most, most};
    ::setrlimit(RLIMIT_AS, &space);
    std::atomic<int> sum{0};
    ForAll(100, [&](int i) { sum += i; });
    ::_exit(sum == 4950 ? 7 : 1);
  };
  EXPECT_EXIT(work(), testing::ExitedWithCode(7), "");
}
#endif

TEST(Transport, SameBytesForAnyNumberOfThreads) {
  auto trace = [](int threads) {
    ThreadLimit limit(threads);
    Transport transport(StillLife(), Rig(), {.seed = 7});
    Image image = *transport.Lamp({48, 36}, {Degrees(12)}, 1, Keep::kNo);
    transport.Projector({48, 36}, {Degrees(12), Degrees(30)}, Keep::kNo)
        ->Add(Image(64, 48, 1, 0.7f), 0.5f, &image);
    return image;
  };
  const Image one = trace(1);
  EXPECT_TRUE(SameBytes(one, trace(2)));
  EXPECT_TRUE(SameBytes(one, trace(5)));
}

TEST(Transport, SeedChangesTheNoiseOnly) {
  auto trace = [](uint64_t seed) {
    Transport transport(StillLife(), Rig(0.2), {.seed = seed});
    return *transport.Lamp({48, 36}, {Degrees(12)}, 1, Keep::kNo);
  };
  const Image a = trace(1), b = trace(2);
  EXPECT_FALSE(SameBytes(a, b));
  EXPECT_NEAR(Mean(a) / Mean(b), 1, 0.02);
}

TEST(Transport, AllKernelsAgree) {
  const RigGeometry rig = Rig(0.1);
  const Scene scene = StillLife();
  const Paths paths(scene, rig.camera, 48, 36, {.bounces = 1, .seed = 3});
  const DiscLight light{{0.5f, 0.2f, 0.8f},    {0.1f, 0, 0}, {0, 0.1f, 0},
                        {-0.5f, -0.2f, -0.8f}, 0.1f,         10};
  auto run = [&](const Kernels& kernels) {
    std::vector<float> all;
    for (const Paths::Block& block : paths.blocks()) {
      std::vector<float> rgb(3 * block.count);
      kernels.disc({scene.handle(), nullptr}, block.arrays, light, block.count, &rgb[0],
                   &rgb[block.count], &rgb[2 * block.count]);
      all.insert(all.end(), rgb.begin(), rgb.end());
    }
    return all;
  };
  const Kernels* usable[kMostKernels];
  const int count = UsableKernels(usable);
  const std::vector<float> a = run(*usable[count - 1]);
  for (int k = 0; k < count; ++k) {
    const std::vector<float> b = run(*usable[k]);
    int different = 0, lit = 0;
    for (size_t i = 0; i < a.size(); ++i) {
      lit += a[i] > 0;
      different += std::abs(a[i] - b[i]) > 1e-3f * (0.1f + a[i]);
    }
    EXPECT_GT(lit, 1000) << usable[k]->name;
    EXPECT_LT(different, lit / 1000 + 1) << usable[k]->name << ": more than rays along an edge";
  }
}

// Random rays onto random triangles, half of them glossy.
struct Packets {
  Packets() {
    std::mt19937 random(5);
    std::uniform_real_distribution<float> unit(0, 1);
    auto fill = [&](auto* packet) {
      auto* const numbers = reinterpret_cast<float*>(packet);
      for (size_t i = 0; i < sizeof(*packet) / sizeof(float); ++i) numbers[i] = unit(random);
    };
    fill(&triangles);
    fill(&samples);
    fill(&surface);
    for (int k = 0; k < kLanes; ++k) {
      const Vec3f direction = Vec3f(unit(random) - 0.5f, unit(random) - 0.5f, -1).normalized();
      rays.ray.dir_x[k] = direction.x();
      rays.ray.dir_y[k] = direction.y();
      rays.ray.dir_z[k] = direction.z();
      rays.hit.u[k] = 0.5f * unit(random);
      rays.hit.v[k] = 0.5f * unit(random);
      if (k % 2 == 0) surface.sr.v[k] = surface.sg.v[k] = surface.sb.v[k] = 0;
    }
  }
  RTCRayHit8 rays = {};
  TrianglePacket triangles;
  SamplePacket samples;
  SurfacePacket surface;
};

TEST(Kernels, AgreeOnSurfaces) {
  const Packets in;
  auto run = [&](const Kernels& kernels) {
    SurfacePacket surface = in.surface;
    kernels.triangles(in.rays, in.triangles, &surface);
    VertexPacket vertices;
    kernels.surface(in.rays, surface, in.samples, &vertices);
    std::vector<float> all(2 * kVertexFloats * kLanes);
    std::memcpy(all.data(), &vertices, sizeof(vertices));
    std::memcpy(&all[kVertexFloats * kLanes], &surface, sizeof(surface));
    return all;
  };
  const std::vector<float> baseline = run(BaselineKernels());
  const Kernels* usable[kMostKernels];
  for (int k = 0, count = UsableKernels(usable); k < count; ++k) {
    const std::vector<float> other = run(*usable[k]);
    for (size_t i = 0; i < baseline.size(); ++i) {
      EXPECT_NEAR(other[i], baseline[i], 1e-4f * (1 + std::abs(baseline[i])))
          << usable[k]->name << ", member " << i / kLanes << " of lane " << i % kLanes;
    }
  }
}

TEST(Kernels, SurfacesKeepTheirTerms) {
  const Packets in;
  SurfacePacket surface = in.surface;
  BestKernels().triangles(in.rays, in.triangles, &surface);
  VertexPacket v;
  BestKernels().surface(in.rays, surface, in.samples, &v);
  for (int k = 0; k < kLanes; ++k) {
    const auto corner = [k](const Lanes* c) { return Vec3f(c[0].v[k], c[1].v[k], c[2].v[k]); };
    const TrianglePacket& t = in.triangles;
    const Vec3f a = corner(t.a), b = corner(t.b), c = corner(t.c);
    const Vec3f direction(in.rays.ray.dir_x[k], in.rays.ray.dir_y[k], in.rays.ray.dir_z[k]);
    Vec3f face = (b - a).cross(c - a).normalized();
    EXPECT_EQ(surface.side.v[k], face.dot(direction) <= 0 ? 1 : -1);
    face *= surface.side.v[k];
    const Vec3f point = a + in.rays.hit.u[k] * (b - a) + in.rays.hit.v[k] * (c - a);
    EXPECT_NEAR((Vec3f(v.x.v[k], v.y.v[k], v.z.v[k]) - point).norm(), 2e-5f, 1e-6f);
    EXPECT_LT((Vec3f(surface.fx.v[k], surface.fy.v[k], surface.fz.v[k]) - face).norm(), 1e-5f);
    EXPECT_EQ(v.share.v[k] > 0, k % 2 == 1) << "only a glossy layer has a share";
    const Vec3f next(v.wx.v[k], v.wy.v[k], v.wz.v[k]);
    EXPECT_NEAR(next.norm(), 1, 1e-5f);
    EXPECT_LE(v.disc_x.v[k] * v.disc_x.v[k] + v.disc_y.v[k] * v.disc_y.v[k], 1.00001f);
    if (face.dot(next) <= 0) {
      EXPECT_EQ(v.fr.v[k], 0) << "no way on through the surface";
    }
  }
}

TEST(Kernels, GatherAddsProducts) {
  constexpr size_t kCount = 37;
  std::vector<float> values(100), r(kCount), g(kCount), b(kCount);
  std::vector<int32_t> source(kCount);
  for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i);
  for (size_t i = 0; i < kCount; ++i) {
    source[i] = static_cast<int32_t>((i * 31) % 100);
    r[i] = 1, g[i] = 2, b[i] = static_cast<float>(i);
  }
  const Kernels* usable[kMostKernels];
  for (int k = 0, count = UsableKernels(usable); k < count; ++k) {
    std::vector<float> sum(3 * kCount, 0.5f);
    usable[k]->gather(values.data(), source.data(), r.data(), g.data(), b.data(), kCount, &sum[0],
                      &sum[kCount], &sum[2 * kCount]);
    for (size_t i = 0; i < kCount; ++i) {
      const auto value = static_cast<float>((i * 31) % 100);
      EXPECT_EQ(sum[i], 0.5f + value);
      EXPECT_EQ(sum[kCount + i], 0.5f + 2 * value);
      EXPECT_EQ(sum[2 * kCount + i], 0.5f + value * static_cast<float>(i));
    }
  }
}

TEST(Transport, KeepsWhatFitsAndNoMore) {
  const size_t one = 48 * 36 * 3 * sizeof(float);
  Transport transport(StillLife(), Rig(), {.cache_bytes = 2 * one + one / 2});
  const FilmSize size{48, 36};
  auto first = transport.Lamp(size, {Degrees(0)}, 0, Keep::kYes);
  transport.Lamp(size, {Degrees(0)}, 1, Keep::kYes);
  EXPECT_EQ(transport.traced(), 2u);
  EXPECT_EQ(transport.Lamp(size, {Degrees(360)}, 0, Keep::kYes), first) << "a turn later";
  EXPECT_EQ(transport.traced(), 2u);
  transport.Lamp(size, {Degrees(0)}, 2, Keep::kYes);  // the least recently used one goes: lamp 1
  EXPECT_LE(transport.cached_bytes(), 2 * one);
  EXPECT_EQ(transport.Lamp(size, {Degrees(0)}, 0, Keep::kYes), first);
  EXPECT_EQ(transport.traced(), 3u);
  transport.Lamp(size, {Degrees(0)}, 1, Keep::kYes);
  EXPECT_EQ(transport.traced(), 4u);
  transport.Lamp(size, {Degrees(5)}, 0, Keep::kNo);
  transport.Lamp(size, {Degrees(5)}, 0, Keep::kNo);
  EXPECT_EQ(transport.traced(), 6u) << "not to be kept";
  EXPECT_TRUE(SameBytes(*transport.Lamp(size, {Degrees(0)}, 0, Keep::kNo), *first));
}

TEST(Scenes, BadMeshIsRefused) {
  Mesh mesh = Floor(1, 0);
  mesh.triangles[0][1] = 99;
  EXPECT_EQ(Scene::Build({{Material{}}, {mesh}}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace lightstage::sim
