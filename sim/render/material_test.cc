// Shapes, media and lenses against closed forms. Each test names its formula.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "optics/pattern.h"
#include "sim/render/environment_light.h"
#include "sim/render/illuminate.h"
#include "sim/render/parallel.h"
#include "sim/render/shapes.h"
#include "sim/render/test_scene.h"

namespace lightstage::sim {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kIntensity = 10;

Scene BuildAll(SceneDescription description) {
  auto scene = Scene::Build(std::move(description));
  EXPECT_TRUE(scene.ok()) << scene.status();
  return *std::move(scene);
}

// ---- Balls and instances

// The integrating sphere again (light_test.cc), as a perfect sphere: one bounce, and its normals from within.
TEST(Ball, IsAnIntegratingSphere) {
  const double radius = 1.5, albedo = 0.7;
  SceneDescription description{{{.diffuse = Rgb::Constant(static_cast<float>(albedo))}}, {}, {}};
  description.balls = {{Vec3f::Zero(), static_cast<float>(radius), 0}};
  const Scene scene = BuildAll(std::move(description));
  BraceGeometry brace{Meters(1), Meters(0.02), {{Degrees(0), Degrees(0)}}};
  const CameraGeometry camera{Vec3(0.2, 0, -0.5), Vec3(0.1, 0.1, 1.5), Degrees(2)};
  const Paths paths(scene, camera, 16, 16, {.samples = 512, .bounces = 2});
  const double seen =
      Mean(Illuminate(scene, paths, LampLight(brace, 0, Degrees(0), kIntensity, 1)));
  const double once = kPi * kIntensity / (4 * kPi * radius * radius);
  EXPECT_NEAR(seen / (albedo / kPi * once * (albedo + albedo * albedo)), 1, 1e-3);
}

// Many refractions, and reflections from within: in a furnace glass cannot be seen, and no ray is lost at the poles or the edge.
TEST(Ball, OfGlassCannotBeSeenInAFurnace) {
  SceneDescription description{{{.kind = Material::Kind::kGlass, .ior = 1.5f}}, {}, {}};
  description.balls = {{Vec3f::Zero(), 0.1f, 0}};
  const Scene scene = BuildAll(std::move(description));
  const EnvironmentLight light(*EnvironmentMap::FromImage(Image(16, 8, 1, 1.0f)), Degrees(0));
  for (double x : {0.0, 0.05, 0.0999}) {
    const CameraGeometry camera{Vec3(0, -1, 0), Vec3(x, 0, 0), Degrees(0.05)};
    const Paths paths(scene, camera, 16, 16, {.samples = 256, .bounces = kMostBounces});
    EXPECT_NEAR(Mean(Illuminate(scene, paths, light)), 1, 1e-3) << x;
  }
}

TEST(Instances, LookLikeMovedCopies) {
  Mesh box = Box(Vec3f::Zero(), {0.02f, 0.03f, 0.04f});
  std::vector<Eigen::Affine3f> placements(2, Eigen::Affine3f::Identity());
  placements[0]
      .translate(Vec3f(0.05f, 0, 0.05f))
      .rotate(Eigen::AngleAxisf(0.5f, Vec3f(1, 1, 0).normalized()));
  placements[1].translate(Vec3f(-0.05f, 0, 0.05f)).scale(1.2f);
  const std::vector<Material> materials = {
      {.diffuse = Rgb::Constant(0.6f), .specular = Rgb::Constant(0.1f), .roughness = 0.3f}};
  Mesh instanced = box;
  instanced.placements = placements;
  const Scene a = BuildScene({Floor(1, 0), instanced}, materials);
  const Scene b = BuildScene(
      {Floor(1, 0), Transformed(box, placements[0]), Transformed(box, placements[1])}, materials);
  const CameraGeometry camera{Vec3(0.2, -0.9, 0.8), Vec3(0, 0, 0.05), Degrees(20)};
  const BraceGeometry brace{Meters(1), Meters(0.02), {{Degrees(20), Degrees(40)}}};
  auto picture = [&](const Scene& scene) {
    const Paths paths(scene, camera, 64, 48, {.samples = 16, .bounces = 1});
    return Illuminate(scene, paths, LampLight(brace, 0, Degrees(0), kIntensity, 1));
  };
  const Image one = picture(a), two = picture(b);
  double difference = 0;
  for (size_t i = 0; i < one.pixels().size(); ++i)
    difference += std::abs(one.pixels()[i] - two.pixels()[i]);
  EXPECT_GT(Mean(one), 0.1);
  EXPECT_LT(difference / static_cast<double>(one.pixels().size()) / Mean(one), 1e-3);
}

// ---- Scattering media

// A half space filled with the medium, lit by a far lamp and seen from above, each at an angle from the vertical.
struct HalfSpace {
  double albedo, anisotropy = 0;
  double free_path = 1e-3;  // m
  double thickness = 0.1;   // m
};

// Radiance per irradiance on a plane that faces the light: one lamp of 1 m² · sr⁻¹ far away.
double Reflected(const HalfSpace& h, double to_light, double to_viewer, int bounces, int samples) {
  const auto half = static_cast<float>(h.thickness / 2);
  const Scene scene = BuildScene({Box({0, 0, -half}, {1, 1, half})},
                                 {{.kind = Material::Kind::kMedium,
                                   .diffuse = Rgb::Constant(static_cast<float>(h.albedo)),
                                   .extinction = static_cast<float>(1 / h.free_path),
                                   .anisotropy = static_cast<float>(h.anisotropy)}});
  constexpr double kDistance = 80;
  const BraceGeometry brace{
      Meters(kDistance), Meters(0.1), {{Degrees(0), Radians(std::acos(to_light))}}};
  const double sine = std::sqrt(1 - to_viewer * to_viewer);
  const CameraGeometry camera{Vec3(0, sine, to_viewer), Vec3::Zero(), Degrees(0.1)};
  const Paths paths(scene, camera, 16, 16, {.samples = samples, .bounces = bounces});
  const double irradiance = kIntensity / (kDistance * kDistance);
  return Mean(Illuminate(scene, paths, LampLight(brace, 0, Degrees(0), kIntensity, 1))) /
         irradiance;
}

double HenyeyGreenstein(double g, double cosine) {
  return (1 - g * g) / (4 * kPi * std::pow(1 + g * g - 2 * g * cosine, 1.5));
}

// Light scattered once in a slab of optical thickness τ (Chandrasekhar, "Radiative Transfer", 1950, ch. III eq. 16 with the phase
// function kept): ω p(Θ) μ0/(μ + μ0) (1 − exp(−τ (1/μ + 1/μ0))) per irradiance on a plane across the light. Light and viewer stand at
// right angles in azimuth: cos Θ = −μ μ0.
TEST(Medium, ScatteredOnceIsTheClosedForm) {
  for (const HalfSpace& h :
       {HalfSpace{0.8}, HalfSpace{0.6, 0.5}, HalfSpace{0.9, -0.7}, HalfSpace{1, 0.3, 5e-2}}) {
    for (const auto& [to_light, to_viewer] : {std::pair(0.9, 0.5), std::pair(0.4, 0.8)}) {
      const double depth = h.thickness / h.free_path * (1 / to_light + 1 / to_viewer);
      const double expected = h.albedo * HenyeyGreenstein(h.anisotropy, -to_light * to_viewer) *
                              to_light / (to_light + to_viewer) * (1 - std::exp(-depth));
      EXPECT_NEAR(Reflected(h, to_light, to_viewer, 0, 512) / expected, 1, 2e-3)
          << "albedo " << h.albedo << ", g " << h.anisotropy << ", light " << to_light;
    }
  }
}

// Chandrasekhar's H function for isotropic scattering, by iterating 1/H(μ) = √(1 − ω) + ω/2 ∫ μ' H(μ')/(μ + μ') dμ' (ch. V eq. 15) on
// midpoints.
double H(double albedo, double mu) {
  constexpr int kNodes = 400;
  std::vector<double> h(kNodes, 1.0);
  auto next = [&](double m) {
    double sum = 0;
    for (int i = 0; i < kNodes; ++i) {
      const double node = (i + 0.5) / kNodes;
      sum += node * h[i] / (m + node) / kNodes;
    }
    return 1 / (std::sqrt(1 - albedo) + albedo / 2 * sum);
  };
  for (int iteration = 0; iteration < 200; ++iteration) {
    std::vector<double> better(kNodes);
    for (int i = 0; i < kNodes; ++i) better[i] = next((i + 0.5) / kNodes);
    h = better;
  }
  return next(mu);
}

// All that a half space reflects (Chandrasekhar ch. III eq. 123): ω/(4π) μ0/(μ + μ0) H(μ) H(μ0) per irradiance across the light.
TEST(Medium, AHalfSpaceReflectsAsChandrasekharSays) {
  EXPECT_NEAR(H(0.9, 1e-9), 1, 1e-6);  // as it must be
  for (double albedo : {0.5, 0.95}) {
    for (const auto& [to_light, to_viewer] : {std::pair(0.9, 0.5), std::pair(0.4, 0.8)}) {
      const double expected = albedo / (4 * kPi) * to_light / (to_light + to_viewer) *
                              H(albedo, to_light) * H(albedo, to_viewer);
      EXPECT_NEAR(Reflected({albedo}, to_light, to_viewer, kMostBounces, 1024) / expected, 1, 5e-3)
          << albedo << ", light " << to_light;
    }
  }
}

// Behind a slab, what is not scattered is exp(−τ): Beer and Lambert, for a lamp that shines through it at an angle onto a floor, once
// the camera looks under it, and once through a slab of perfect absorber.
TEST(Medium, LightThroughItIsBeerLambert) {
  const double free_path = 0.02, thickness = 0.03;
  const Material absorber{.kind = Material::Kind::kMedium,
                          .extinction = static_cast<float>(1 / free_path)};
  const Scene scene = [&] {
    Mesh floor = Floor(2, 0), slab = Box({0, 0, 0.3f}, {1, 1, static_cast<float>(thickness / 2)});
    slab.material = 1;
    return BuildScene({floor, slab}, {{.diffuse = Rgb::Constant(0.5f)}, absorber});
  }();
  const BraceGeometry brace{Meters(1), Meters(0.001), {{Degrees(0), Degrees(50)}}};
  const double cosine = std::cos(50 * kPi / 180);
  const double full = 0.5 / kPi * kIntensity * cosine;
  auto seen = [&](const Vec3& from) {
    const Paths paths(scene, {from, Vec3::Zero(), Degrees(0.01)}, 16, 16, {.samples = 1024});
    return Mean(Illuminate(scene, paths, LampLight(brace, 0, Degrees(0), kIntensity, 1)));
  };
  const double light_way = thickness / cosine;
  EXPECT_NEAR(seen(Vec3(0, -0.3, 0.2)) / (full * std::exp(-light_way / free_path)), 1, 1e-3);
  // Seen through it too, as steeply as it is lit: the camera's paths are cut at random.
  const Vec3 above(0, -std::tan(50 * kPi / 180), 1);
  EXPECT_NEAR(seen(above) / (full * std::exp(-2 * light_way / free_path)), 1, 1e-2);
}

// A medium that does not absorb, in a furnace: nothing can be seen of it. What stands in it can be seen through it.
TEST(Medium, WithoutAbsorptionCannotBeSeenInAFurnace) {
  SceneDescription description{{{.kind = Material::Kind::kMedium,
                                 .diffuse = Rgb::Ones(),
                                 .extinction = 40,
                                 .anisotropy = 0.4f},
                                {.diffuse = Rgb::Ones()}},
                               {},
                               {}};
  description.balls = {{Vec3f::Zero(), 0.1f, 0}, {Vec3f(0.02f, 0, 0), 0.03f, 1}};
  const Scene scene = BuildAll(std::move(description));
  const EnvironmentLight light(*EnvironmentMap::FromImage(Image(16, 8, 1, 1.0f)), Degrees(0));
  const Paths paths(scene, {Vec3(0, -1, 0), Vec3::Zero(), Degrees(14)}, 16, 16,
                    {.samples = 1024, .bounces = kMostBounces});
  EXPECT_NEAR(Mean(Illuminate(scene, paths, light)), 1, 4e-3);
}

// So thin that rays leave it within a few micrometres of where they came in.
TEST(Medium, ThinPlacesLeakNoLight) {
  SceneDescription description{
      {{.kind = Material::Kind::kMedium, .diffuse = Rgb::Ones(), .extinction = 1e3f}}, {}, {}};
  description.balls = {{Vec3f::Zero(), 1e-4f, 0}};
  const Scene scene = BuildAll(std::move(description));
  const EnvironmentLight light(*EnvironmentMap::FromImage(Image(16, 8, 1, 1.0f)), Degrees(0));
  const CameraGeometry camera{Vec3(0, -0.01, 0), Vec3::Zero(), Degrees(1.1)};
  const Paths paths(scene, camera, 16, 16, {.samples = 1024, .bounces = kMostBounces});
  EXPECT_NEAR(Mean(Illuminate(scene, paths, light)), 1, 4e-3);
}

TEST(Scenes, GlassAndMediaMustBeClosed) {
  for (const Material& m : {Material{.kind = Material::Kind::kGlass},
                            Material{.kind = Material::Kind::kMedium, .extinction = 100}}) {
    Mesh open = Box(Vec3f::Zero(), Vec3f::Ones());
    open.name = "box.off";
    open.triangles.pop_back();
    const absl::Status status = Scene::Build({{m}, {open}, {}}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(status.message().find("box.off: it is not closed"), std::string::npos) << status;
    EXPECT_NE(status.message().find("triangle"), std::string::npos) << status;
    EXPECT_TRUE(Scene::Build({{m},
                              {Box(Vec3f::Zero(), Vec3f::Ones()), Sphere(Vec3f(3, 0, 0), 1),
                               Rod(Vec3f(9, 0, 0), Vec3f(9, 1, 1), 0.1f)},
                              {}})
                    .ok());
  }
}

TEST(Scenes, WhatCannotBeIsRefusedByNameAndElement) {
  auto refused = [](auto change, const std::string& words) {
    Mesh mesh = Box(Vec3f::Zero(), Vec3f::Ones());
    mesh.name = "thing.ply";
    SceneDescription description{
        {{.diffuse = Rgb::Constant(0.5f)}}, {mesh}, {{Vec3f(5, 0, 0), 1, 0}}};
    change(description);
    const absl::Status status = Scene::Build(std::move(description)).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << words;
    EXPECT_NE(status.message().find(words), std::string::npos) << status;
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  refused([&](auto& d) { d.meshes[0].vertices[3].y() = nan; }, "thing.ply: vertex 3");
  refused([&](auto& d) { d.meshes[0].vertices[3].y() = 1e9f; }, "thing.ply: vertex 3");
  refused([&](auto& d) { d.meshes[0].normals[2] = Vec3f::Zero(); },
          "thing.ply: the normal of vertex 2");
  refused([&](auto& d) { d.meshes[0].triangles[5][1] = 77; },
          "thing.ply: triangle 5 has the vertex 77");
  refused([&](auto& d) { d.meshes[0].triangles[4][1] = d.meshes[0].triangles[4][0]; },
          "thing.ply: triangle 4");
  refused([&](auto& d) { d.meshes[0].triangles.clear(); }, "no triangles");
  refused([&](auto& d) { d.meshes[0].uvs.resize(3); }, "3 texture coordinates");
  refused([&](auto& d) { d.meshes[0].material = 1; }, "thing.ply: it has the material 1");
  refused(
      [&](auto& d) {
        d.meshes[0].placements = {Eigen::Affine3f::Identity()};
        d.meshes[0].placements[0].linear()(0, 0) = 2;
      },
      "thing.ply: placement 0");
  refused([&](auto& d) { d.balls[0].radius = 0; }, "ball 0");
  refused([&](auto& d) { d.balls[0].material = -1; }, "ball 0");
  refused([&](auto& d) { d.materials[0].diffuse.x() = 1.5f; }, "material 0");
  refused([&](auto& d) { d.materials[0].roughness = 0; }, "material 0");
  refused([&](auto& d) { d.materials[0] = {.kind = Material::Kind::kMedium}; }, "extinction");
}

TEST(Scenes, ACameraInsideAnObjectIsRefusedByTheObjectsName) {
  Mesh box = Box({0, 0, 0.5f}, {0.1f, 0.1f, 0.1f}), room = Box(Vec3f::Zero(), {4, 4, 4});
  box.name = "crate.obj";
  for (auto& t : room.triangles) std::swap(t[1], t[2]);  // walls face inwards
  for (Vec3f& n : room.normals) n = -n;
  const Scene scene = BuildScene({box, room, Floor(1, 0)}, {{.diffuse = Rgb::Constant(0.5f)}});
  EXPECT_TRUE(scene.CheckOutside(Vec3f(0.3f, 0, 0.5f), "the camera").ok());
  EXPECT_TRUE(scene.CheckOutside(Vec3f(0, 0, 0.7f), "the camera").ok());
  const absl::Status status = scene.CheckOutside(Vec3f(0.03f, 0.02f, 0.51f), "the camera");
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(status.message().find("the camera"), std::string::npos);
  EXPECT_NE(status.message().find("crate.obj"), std::string::npos);
}

// ---- The projector's lens

ProjectorGeometry Overhead() { return {true, Meters(1), Degrees(0), Degrees(20), 64, 48}; }

// Where light from one pixel of the projector falls on the ground: how far its middle is from where the pixel is projected to, m, and
// its mean squared distance from the middle.
struct Spot {
  double off;
  double spread;
};

Spot SpotOf(const LensOptions& lens, int column, int row, double ground_z) {
  const Scene scene =
      BuildScene({Floor(5, static_cast<float>(ground_z))}, {{.diffuse = Rgb::Constant(0.5f)}});
  // Looks straight down at where the pixel should be, at 5 cm of the ground.
  const ViewFrame projector = ProjectorFrame(Overhead(), {Degrees(0), Degrees(0)});
  const double tan = std::tan(10 * kPi / 180) * (1 - ground_z);
  const Vec3 expected = ((column + 0.5) / 64 * 2 - 1) * tan * projector.right +
                        ((row + 0.5) / 48 * 2 - 1) * tan * 48 / 64 * projector.down +
                        Vec3(0, 0, ground_z);
  const CameraGeometry camera{expected + Vec3(0, 0, 3), expected,
                              Radians(2 * std::atan(0.025 / 3))};
  constexpr int kSize = 100;
  const Paths paths(scene, camera, kSize, kSize, {.samples = 64});
  const LensLight light = ProjectorLight(Overhead(), lens, {Degrees(0), Degrees(0)}, kIntensity, 1);
  Image raster(64, 48, 1), picture(kSize, kSize, 3);
  raster.at(column, row, 0) = 1;
  Illuminate(scene, paths, light).Add(raster, 1, &picture);
  const ViewFrame frame = CameraFrame(camera);
  const double scale = 0.025;
  double sum = 0, square = 0;
  Vec3 middle = Vec3::Zero();
  for (int pass = 0; pass < 2; ++pass) {
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const Vec3 at = ((x + 0.5) / kSize * 2 - 1) * scale * frame.right +
                        ((y + 0.5) / kSize * 2 - 1) * scale * frame.down;
        if (pass == 0) {
          sum += picture.at(x, y, 0);
          middle += picture.at(x, y, 0) * at;
        } else {
          square += picture.at(x, y, 0) * (at - middle).squaredNorm();
        }
      }
    }
    if (pass == 0) middle /= sum;
  }
  return {middle.norm(), square / sum};
}

// A thin lens of radius r in focus at distance f spreads a point over a disc of radius r |d − f| / f at distance d, evenly: its mean
// square is half of that radius squared, and adds to the pixel's own.
TEST(Lens, DefocusIsThatOfAThinLens) {
  const double radius = 0.03, focus = 0.8, distance = 1.15;
  const double blur = radius * (distance - focus) / focus;
  const double pixel = 2 * std::tan(10 * kPi / 180) * distance / 64;
  const Spot spot = SpotOf({Meters(radius), Meters(focus)}, 32, 24, 1 - distance);
  EXPECT_NEAR(std::sqrt(2 * (spot.spread - pixel * pixel / 6)) / blur, 1, 0.01);
  // In focus it is as sharp as a pinhole's.
  const Spot sharp = SpotOf({Meters(radius), Meters(distance)}, 32, 24, 1 - distance),
             pinhole = SpotOf({}, 32, 24, 1 - distance);
  EXPECT_NEAR(std::sqrt(sharp.spread / pinhole.spread), 1, 0.02);
}

// Pixels land where they are projected to, whatever the lens.
TEST(Lens, PixelsLandWhereTheyAreProjected) {
  for (const LensOptions& lens : {LensOptions{}, LensOptions{Meters(0.02), Meters(1)},
                                  LensOptions{Meters(0.02), Meters(0.7)}}) {
    for (const auto& [column, row] : {std::pair(32, 24), std::pair(8, 40), std::pair(60, 3)}) {
      const double pixel = 2 * std::tan(10 * kPi / 180) / 64;
      EXPECT_LT(SpotOf(lens, column, row, 0).off, 0.05 * pixel) << column << ", " << row;
    }
  }
}

// A wall in focus.
TEST(Lens, IsAsBrightAsItsPinhole) {
  const Scene scene = BuildScene({Floor(5, 0)}, {{.diffuse = Rgb::Constant(0.5f)}});
  const CameraGeometry camera{Vec3(0, -0.4, 1), Vec3(0.05, 0.03, 0), Degrees(3)};
  const Paths paths(scene, camera, 16, 16, {.samples = 256});
  const Image white(64, 48, 1, 1.0f);
  Image picture(16, 16, 3);
  Illuminate(scene, paths, ProjectorLight(Overhead(), {Meters(0.05), Meters(1)}, {}, kIntensity, 1))
      .Add(white, 1, &picture);
  // As a lamp of its size: I / (D² + r²).
  EXPECT_NEAR(Mean(picture) / (0.5 / kPi * kIntensity / (1 + 0.05 * 0.05)), 1, 5e-4);
}

// A highlight of the lens on a glossy floor: found both ways, weighted, against connection alone, as on a layer that is a little rougher.
TEST(Lens, HighlightsDoNotDependOnHowTheyAreFound) {
  auto seen = [](float roughness) {
    const Scene scene =
        BuildScene({Floor(5, 0)}, {{.specular = Rgb::Constant(0.5f), .roughness = roughness}});
    const CameraGeometry camera{Vec3(0, -0.5, 1), Vec3::Zero(), Degrees(40)};
    const Paths paths(scene, camera, 32, 32, {.samples = 2048});
    Image picture(32, 32, 3);
    Illuminate(scene, paths,
               ProjectorLight(Overhead(), {Meters(0.05), Meters(1)}, {}, kIntensity, 1))
        .Add(Image(64, 48, 1, 1.0f), 1, &picture);
    return Mean(picture);
  };
  EXPECT_NEAR(seen(0.2499f) / seen(0.2501f), 1, 5e-3);
}

// ---- What holds for all light

// Balls of everything on a board, seen and lit from two places.
Scene Everything(bool glass = true) {
  SceneDescription description;
  description.materials = {
      {.diffuse = Rgb(0.6f, 0.5f, 0.4f)},
      {.diffuse = Rgb::Constant(0.5f), .specular = Rgb::Constant(0.05f), .roughness = 0.15f},
      {.specular = Rgb(0.9f, 0.7f, 0.3f), .roughness = 0.3f},
      {.kind = Material::Kind::kMedium,
       .diffuse = Rgb::Constant(0.9f),
       .extinction = 100,
       .anisotropy = 0.4f},
      {.kind = Material::Kind::kGlass}};
  description.meshes = {Floor(0.4f, 0)};
  for (int i = 1; i < (glass ? 5 : 4); ++i) {
    description.balls.push_back(
        {Vec3f(0.11f * static_cast<float>(i) - 0.275f, 0.02f * static_cast<float>(i % 2), 0.05f),
         0.05f, i});
  }
  return BuildAll(std::move(description));
}

// Helmholtz: with camera and projector in each other's place light goes the same ways backwards. A pixel's value is a mean over its part of
// the image plane, and a projector's pixel lights a wall evenly; with pixels of one size the transport is therefore just transposed. The
// error is known from the spread over seeds. No glass: its caustics come from so few paths that their spread is not.
TEST(Transport, IsTransposedWhenCameraAndProjectorChangePlaces) {
  const Scene scene = Everything(false);
  constexpr int kSize = 4, kPixels = kSize * kSize, kSeeds = 16;
  const Angle field = Degrees(16), azimuth[2] = {Degrees(-70), Degrees(-110)},
              tilt[2] = {Degrees(50), Degrees(60)};
  constexpr double kDistance = 1.5;
  struct Estimate {
    Eigen::ArrayXXd mean, variance;  // of the mean; camera's pixel by projector's
  };
  auto transport = [&](int camera, int projector) {
    const CameraGeometry view{kDistance * DirectionFromAngles(azimuth[camera], tilt[camera]),
                              Vec3::Zero(), field};
    const ProjectorGeometry light{true, Meters(kDistance), azimuth[projector], field, kSize, kSize};
    Eigen::ArrayXXd sum = Eigen::ArrayXXd::Zero(kPixels, kPixels), squares = sum;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const Paths paths(scene, view, kSize, kSize,
                        {.samples = 4096, .bounces = 4, .seed = 2 * seed + camera});
      const ProjectorTransport traced = Illuminate(
          scene, paths, ProjectorLight(light, {}, {Degrees(0), tilt[projector]}, kIntensity, seed));
      for (int j = 0; j < kPixels; ++j) {
        Image raster(kSize, kSize, 1), picture(kSize, kSize, 3);
        raster.at(j % kSize, j / kSize, 0) = 1;
        traced.Add(raster, 1, &picture);
        for (int i = 0; i < kPixels; ++i) {
          const double v = picture.at(i % kSize, i / kSize, 1);
          sum(i, j) += v;
          squares(i, j) += v * v;
        }
      }
    }
    const Eigen::ArrayXXd mean = sum / kSeeds;
    return Estimate{mean, (squares / kSeeds - mean.square()).max(0.0) / (kSeeds - 1)};
  };
  const Estimate one = transport(0, 1), two = transport(1, 0);
  EXPECT_NEAR(one.mean.sum() / two.mean.sum(), 1, 3e-3);
  const Eigen::ArrayXXd difference = (one.mean - two.mean.transpose()).abs(),
                        error = (one.variance + two.variance.transpose()).sqrt();
  EXPECT_LT(difference.sum() / one.mean.sum(), 0.01);
  EXPECT_GT((one.mean > 1e-3 * one.mean.maxCoeff()).count(), 60) << "most pixels light each other";
  // Of 256 elements; with 16 seeds the estimate of the error itself is 18 % off.
  EXPECT_LT((difference > 5 * error + 1e-4 * one.mean.maxCoeff()).count(), 2);
}

TEST(Transport, PatternsAddUpAndThreadsDoNotMatter) {
  const Scene scene = Everything();
  const CameraGeometry camera{Vec3(0.2, -0.9, 0.8), Vec3::Zero(), Degrees(25)};
  auto trace = [&] {
    const Paths paths(scene, camera, 48, 36, {.samples = 4, .bounces = 5});
    return Illuminate(scene, paths,
                      ProjectorLight(Overhead(), {Meters(0.02), Meters(0.9)},
                                     {Degrees(20), Degrees(30)}, kIntensity, 1));
  };
  const ProjectorTransport traced = trace();
  auto picture = [&](const ProjectorTransport& transport, const Pattern& pattern) {
    Image image(48, 36, 3);
    transport.Add(Rasterize(pattern, 64, 48), 1, &image);
    return image;
  };
  const Image full = picture(traced, {PatternArrangement::kFull});
  Image sum(48, 36, 3);
  for (int k = 0; k < 16; ++k) {
    const Image part = picture(
        traced, {PatternArrangement::kSquare, PatternProfile::kGaussian, 4, 0, k % 4, k / 4});
    for (size_t i = 0; i < sum.pixels().size(); ++i) sum.pixels()[i] += part.pixels()[i];
  }
  EXPECT_GT(Mean(full), 0.01);
  for (size_t i = 0; i < sum.pixels().size(); ++i) {
    ASSERT_NEAR(sum.pixels()[i], full.pixels()[i], 1e-5 * (1 + full.pixels()[i]));
  }
  const ThreadLimit one(1);
  const Image again = picture(trace(), {PatternArrangement::kFull});
  EXPECT_TRUE(std::equal(full.pixels().begin(), full.pixels().end(), again.pixels().begin()));
}

}  // namespace
}  // namespace lightstage::sim
