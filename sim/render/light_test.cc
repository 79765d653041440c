// Light that is scattered more than once, and what shines or refracts it, against closed forms. Each test names its formula.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "sim/render/environment_light.h"
#include "sim/render/illuminate.h"
#include "sim/render/shapes.h"
#include "sim/render/test_scene.h"

namespace lightstage::sim {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kIntensity = 10;

// One lamp in the zenith, 1 m above the origin, shining down; a camera that sees one spot.
RigGeometry OneLamp(const Vec3& camera, const Vec3& at, double lamp_radius_m = 0.02) {
  RigGeometry rig;
  rig.brace.radius = Meters(1);
  rig.brace.lamp_radius = Meters(lamp_radius_m);
  rig.brace.lamps = {{Degrees(0), Degrees(0)}};
  rig.camera = {camera, at, Degrees(2)};
  return rig;
}

double Seen(const Scene& scene, const RigGeometry& rig, int bounces, int samples,
            uint64_t seed = 1) {
  const Paths paths(scene, rig.camera, 16, 16,
                    {.samples = samples, .bounces = bounces, .seed = seed});
  return Mean(Illuminate(scene, paths, LampLight(rig.brace, 0, Degrees(0), kIntensity, seed)));
}

// ---- Direct light

// A spot of the ground, seen from 30° beside the vertical.
CameraGeometry Spot(const Vec3& at) { return {at + Vec3(0.1, -0.5, 0.8), at, Degrees(0.01)}; }

// A plane element sees a parallel disc, of radius r at height h and its axis at distance a, with the configuration factor
// F = ½ (1 − (Z − 2R²) / √(Z² − 4R²)), R = r/a, H = h/a, Z = 1 + H² + R² (Howell's catalogue, B-12); its irradiance is π L F.
TEST(Disc, IrradianceOnAndOffTheAxisIsTheClosedForm) {
  constexpr float kAlbedo = 0.5f;
  const Scene scene = BuildScene({Floor(5, 0)}, {{.diffuse = Rgb::Constant(kAlbedo)}});
  for (double r : {0.02, 0.3}) {
    const double radiance = kIntensity / (kPi * r * r);
    for (double a : {1e-3, 0.3, 0.8, 2.0}) {
      const double ratio = r / a, h = 1 / a, z = 1 + h * h + ratio * ratio;
      const double factor =
          0.5 * (1 - (z - 2 * ratio * ratio) / std::sqrt(z * z - 4 * ratio * ratio));
      const double expected = kAlbedo / kPi * kPi * radiance * factor;
      RigGeometry rig = OneLamp(Vec3::Zero(), Vec3::Zero(), r);
      rig.camera = Spot(Vec3(a, 0, 0));
      EXPECT_NEAR(Seen(scene, rig, 0, 256) / expected, 1, 5e-4)
          << "radius " << r << ", off the axis " << a;
    }
  }
}

// A Lambertian sphere under a small lamp at distance D of its middle: L = ρ/π · I · cos(lamp) cos(surface) / d².
TEST(Disc, ASphereUnderANearLampIsTheClosedForm) {
  constexpr double kRadius = 0.3;
  constexpr float kAlbedo = 0.7f;
  const Scene scene =
      BuildScene({Sphere(Vec3f::Zero(), kRadius, 1024)}, {{.diffuse = Rgb::Constant(kAlbedo)}});
  for (double tilt : {0.2, 0.5, 0.9, 1.2}) {
    const Vec3 normal(std::sin(tilt), 0, std::cos(tilt)), point = kRadius * normal,
                                                          to_lamp = Vec3::UnitZ() - point;
    const double d2 = to_lamp.squaredNorm();
    const double expected = kAlbedo / kPi * kIntensity * to_lamp.normalized().dot(normal) *
                            to_lamp.normalized().z() / d2;
    RigGeometry rig = OneLamp(point + 0.5 * normal + Vec3(0, -0.3, 0), point, 1e-4);
    rig.camera.field_of_view = Degrees(0.01);
    EXPECT_NEAR(Seen(scene, rig, 0, 16) / expected, 1, 5e-4) << tilt;
  }
}

// A straight edge half-way between a disc of radius r and the ground throws a penumbra from −r to r, in which the share of the disc
// that is seen is that of a circle cut by a straight line: (arccos t − t√(1 − t²)) / π at t = x/r.
TEST(Disc, PenumbraIsThatOfADiscBehindAnEdge) {
  constexpr double kRadius = 0.02;
  constexpr int kPixels = 500;                                   // 0.1 mm each
  const Mesh cover = Box({2.0f, 0, 0.5f}, {2.0f, 2.0f, 1e-6f});  // x > 0
  const Scene scene = BuildScene({Floor(5, 0), cover}, {{.diffuse = Rgb::Constant(0.5f)}});
  // From below the cover, straight at the edge's shadow.
  RigGeometry rig = OneLamp(Vec3(0, -0.05, 0.4), Vec3(0, 0, 0), kRadius);
  const double distance = rig.camera.position.norm();
  rig.camera.field_of_view = Radians(2 * std::atan(0.025 / distance));
  const Paths paths(scene, rig.camera, kPixels, 4, {.samples = 4096});
  const Image image = Illuminate(scene, paths, LampLight(rig.brace, 0, Degrees(0), kIntensity, 1));
  int between = 0;
  for (int x = 0; x < kPixels; ++x) {
    const double at = (x + 0.5 - kPixels / 2.0) * 1e-4;  // m, towards the cover
    double seen = 0;
    for (int y = 0; y < 4; ++y) seen += image.at(x, y, 0) / 4;
    // Of the whole lamp, nearly straight above: 1/(1 + r²) on the axis, and cosines and distance beside it.
    const double full = 0.5 / kPi * kIntensity / (1 + kRadius * kRadius) / std::pow(1 + at * at, 2);
    const double t = std::clamp(at / kRadius, -1.0, 1.0);
    const double share = (std::acos(t) - t * std::sqrt(1 - t * t)) / kPi;
    EXPECT_NEAR(seen / full, share, 2e-3) << at;
    // Its ends: to 0.1 mm.
    const double beyond = std::abs(at) > kRadius + 1e-4 ? 1e-9 + (at < 0) * 5e-4 : 1;
    EXPECT_NEAR(seen / full, share, beyond) << at;
    between += share > 0 && share < 1;
  }
  EXPECT_GT(between, 380);
}

// ---- Light between surfaces

// Inside a Lambertian sphere every point gets the same share of what every other one sends (the integrating sphere): a flux Φ that
// meets the wall of albedo ρ gives, after n scatterings, the irradiance Φ ρⁿ / (4πR²) everywhere. A Lambertian lamp sends Φ = π I. The
// lamp shines down, so that the wall above it has no direct light.
TEST(Sphere, EveryBounceIsTheClosedForm) {
  const double radius = 1.5;
  for (double albedo : {0.5, 0.9}) {
    const Scene scene = BuildScene({Sphere(Vec3f::Zero(), static_cast<float>(radius), 256)},
                                   {{.diffuse = Rgb::Constant(static_cast<float>(albedo))}});
    const RigGeometry rig = OneLamp(Vec3(0.2, 0, -0.5), Vec3(0.1, 0.1, 1.5));
    const double once = kPi * kIntensity / (4 * kPi * radius * radius);
    EXPECT_NEAR(Seen(scene, rig, 0, 16), 0, 1e-9);
    double irradiance = 0, power = 1;
    for (int bounces = 1; bounces <= 3; ++bounces) {
      power *= albedo;
      irradiance += once * power;
      const double expected = albedo / kPi * irradiance;
      EXPECT_NEAR(Seen(scene, rig, bounces, 512) / expected, 1, 1e-3)
          << albedo << ", " << bounces << " bounces";
    }
    // All bounces, ended by Russian roulette.
    EXPECT_NEAR(
        Seen(scene, rig, kMostBounces, 1024) / (albedo / kPi * once * albedo / (1 - albedo)), 1,
        3e-3)
        << albedo;
  }
}

// Independent seeds: their spread is the error, which falls with the samples at least as 1/√n, and their mean does not depend on n.
TEST(Sphere, ErrorFallsWithTheSamplesAndThereIsNoBias) {
  const Scene scene =
      BuildScene({Sphere(Vec3f::Zero(), 1.5f, 128)}, {{.diffuse = Rgb::Constant(0.7f)}});
  const RigGeometry rig = OneLamp(Vec3(0.2, 0, -0.5), Vec3(0.1, 0.1, 1.5));
  constexpr int kSeeds = 40;
  struct Spread {
    double mean = 0, deviation = 0;
  };
  auto spread = [&](int samples) {
    std::vector<double> seen;
    for (int seed = 0; seed < kSeeds; ++seed)
      seen.push_back(Seen(scene, rig, 4, samples, static_cast<uint64_t>(1000 + seed)));
    Spread s;
    for (double v : seen) s.mean += v / kSeeds;
    for (double v : seen) s.deviation += (v - s.mean) * (v - s.mean) / (kSeeds - 1);
    s.deviation = std::sqrt(s.deviation);
    return s;
  };
  const Spread few = spread(1), many = spread(16);
  // The deviation of a deviation of 40 is 11 %: three of them, twice.
  EXPECT_LT(many.deviation / few.deviation, 1.5 / 4);
  const double error = std::hypot(few.deviation, many.deviation) / std::sqrt(kSeeds);
  EXPECT_NEAR(few.mean, many.mean, 4 * error);
}

// ---- The white furnace: under light of radiance 1 from everywhere, a surface shows what it reflects of all light.

double Furnace(const std::vector<Mesh>& meshes, const Material& material,
               const CameraGeometry& camera, int bounces, int samples) {
  const Scene scene = BuildScene(meshes, {material});
  const EnvironmentLight light(*EnvironmentMap::FromImage(Image(16, 8, 1, 1.0f)), Degrees(0));
  const Paths paths(scene, camera, 16, 16, {.samples = samples, .bounces = bounces});
  return Mean(Illuminate(scene, paths, light));
}

// Looks at the middle of a ball of 0.1 m, so that every ray meets it nearly head-on, or at `at`.
const Mesh kBall = Sphere(Vec3f::Zero(), 0.1f, 512);
CameraGeometry AtBall(const Vec3& at = Vec3::Zero()) { return {Vec3(0, -1, 0), at, Degrees(0.2)}; }

TEST(Furnace, LambertReflectsItsAlbedo) {
  for (float albedo : {0.3f, 1.0f}) {
    EXPECT_NEAR(Furnace({kBall}, {.diffuse = Rgb::Constant(albedo)}, AtBall(), 0, 1024), albedo,
                5e-4 * albedo);
  }
  // In a furnace of albedo 1 nothing can be seen, however often light is scattered: here in a bowl.
  const Mesh bowl =
      Lathe({0, 0, -0.1f}, {{0.001f, 0.0f}, {0.1f, 0.1f}, {0.099f, 0.1f}, {0.0f, 0.002f}});
  EXPECT_NEAR(Furnace({bowl}, {.diffuse = Rgb::Ones()},
                      {Vec3(0.1, 0, 1), Vec3(0, 0, -0.05), Degrees(4)}, kMostBounces, 1024),
              1, 6e-3);
}

TEST(Furnace, MirrorReflectsItsReflectance) {
  Material mirror{.kind = Material::Kind::kMirror, .specular = Rgb(0.9f, 0.6f, 0.3f)};
  EXPECT_NEAR(Furnace({kBall}, mirror, AtBall(), 0, 16), 0.6, 1e-6);
}

TEST(Furnace, GlassCannotBeSeen) {
  Material glass{.kind = Material::Kind::kGlass, .ior = 1.5f};
  for (const Vec3& at : {Vec3(0, 0, 0), Vec3(0.05, 0, 0), Vec3(0.09, 0, 0)}) {
    EXPECT_NEAR(Furnace({kBall}, glass, AtBall(at), kMostBounces, 256), 1, 2e-3) << at.x();
  }
}

// The model's own albedo at one angle of view, by a quadrature over the hemisphere that knows nothing of how it is sampled.
double LayerAlbedo(const Material& m, double cosine) {
  const Vec3 v(std::sqrt(1 - cosine * cosine), 0, cosine);
  double sum = 0;
  constexpr int kTilts = 400, kAzimuths = 200;
  for (int i = 0; i < kTilts; ++i) {
    const double z = (i + 0.5) / kTilts, r = std::sqrt(1 - z * z);
    for (int j = 0; j < kAzimuths; ++j) {
      const double azimuth = 2 * kPi * (j + 0.5) / kAzimuths;
      const Vec3 l(r * std::cos(azimuth), r * std::sin(azimuth), z), h = (l + v).normalized();
      // Walter et al. 2007 (GGX), Heitz 2014 (masking), Schlick 1994, Ashikhmin and Shirley 2000.
      const double a2 = m.roughness * m.roughness, f0 = m.specular[0];
      const double d = a2 / (kPi * std::pow(h.z() * h.z() * (a2 - 1) + 1, 2));
      auto lambda = [a2](double c) { return (-1 + std::sqrt(1 + a2 * (1 - c * c) / (c * c))) / 2; };
      const double g = 1 / (1 + lambda(z) + lambda(cosine));
      const double f = f0 + (1 - f0) * std::pow(1 - h.dot(v), 5);
      const double base = 28 * m.diffuse[0] / (23 * kPi) * (1 - f0) * (1 - std::pow(1 - z / 2, 5)) *
                          (1 - std::pow(1 - cosine / 2, 5));
      sum += (d * g * f / (4 * z * cosine) + base) * z;
    }
  }
  return sum * 2 * kPi / kTilts / kAzimuths;
}

TEST(Furnace, PlasticAndMetalReflectWhatTheirModelSays) {
  for (const Material& m :
       {Material{
            .diffuse = Rgb::Constant(0.8f), .specular = Rgb::Constant(0.04f), .roughness = 0.1f},
        Material{
            .diffuse = Rgb::Constant(1.0f), .specular = Rgb::Constant(0.04f), .roughness = 0.5f},
        Material{.specular = Rgb::Constant(0.9f), .roughness = 0.2f},
        Material{.specular = Rgb::Constant(1.0f), .roughness = 0.7f}}) {
    for (double cosine : {1.0, 0.7, 0.3}) {
      const double expected = LayerAlbedo(m, cosine);
      EXPECT_LE(expected, 1 + 1e-6) << "makes light";
      // A plane seen at that angle.
      const double sine = std::sqrt(1 - cosine * cosine);
      const CameraGeometry camera{Vec3(sine, 0, cosine), Vec3::Zero(), Degrees(0.01)};
      EXPECT_NEAR(Furnace({Floor(1, 0)}, m, camera, 0, 1024) / expected, 1, 1e-3)
          << m.roughness << " at " << cosine;
    }
  }
}

// ---- Light that differs from place to place

// A field that brightens evenly from black to 1 across its grid, on the very ground: a point there sees the same from all directions,
// and shows albedo · its share of the way. Beyond the edge it is as at the edge.
TEST(LightField, IsBilinearWhereItsPlaneIsCrossed) {
  auto map = [](float v) { return *EnvironmentMap::FromImage(Image(8, 4, 3, v)); };
  const IncidentLightField field({map(0), map(1), map(0), map(1)}, 2, 2, Vec3(-0.2, -0.3, 0),
                                 Vec3(0.4, 0, 0), Vec3(0.05, 0.6, 0));
  const Scene scene = BuildScene({Floor(5, 0)}, {{.diffuse = Rgb::Constant(0.5f)}});
  for (const auto& [x, share] :
       {std::pair(-0.1, 0.25), std::pair(0.15, 0.875), std::pair(0.3, 1.0)}) {
    // u and v are not square: a step along v moves x by 1/12 of it.
    for (double y : {-0.3, 0.15}) {
      const double along = std::clamp(share - (y + 0.3) / 12 / 0.4, 0.0, 1.0),
                   expected = share == 1 ? 1 : along;
      const Paths paths(scene, Spot(Vec3(x, y, 0)), 16, 16, {.samples = 1024});
      EXPECT_NEAR(Mean(Illuminate(scene, paths, field)) / (0.5 * expected), 1, 2e-3)
          << x << ", " << y;
    }
  }
  // On its way down a slanted line crosses the plane elsewhere: 10 cm above the ground, at 45° towards +x, 10 cm further.
  EXPECT_NEAR(field.At(Vec3(0, -0.3, -0.1), Vec3(1, 0, 1).normalized()).x(), 0.75, 1e-9);
  EXPECT_NEAR(field.At(Vec3(0, -0.3, 0.1), Vec3(1, 0, 1).normalized()).x(), 0.25, 1e-9)
      << "the line's other side";
}

TEST(LightField, OfEqualMapsIsAnEnvironment) {
  Image picture(16, 8, 3);
  for (size_t i = 0; i < picture.pixels().size(); ++i)
    picture.pixels()[i] = static_cast<float>((i * 37) % 11);
  const EnvironmentMap map = *EnvironmentMap::FromImage(std::move(picture));
  const IncidentLightField field(std::vector<EnvironmentMap>(6, map), 3, 2, Vec3(-1, -1, 0.5),
                                 Vec3(2, 0, 0), Vec3(0, 2, 0));
  const EnvironmentLight light(map, Degrees(0));
  const Scene scene = BuildScene(
      {Floor(0.2f, 0), Sphere(Vec3f(0, 0, 0.05f), 0.05f)},
      {{.diffuse = Rgb::Constant(0.5f), .specular = Rgb::Constant(0.1f), .roughness = 0.2f}});
  const Paths paths(scene, {Vec3(0, -1, 0.5), Vec3::Zero(), Degrees(20)}, 24, 24,
                    {.samples = 8, .bounces = 2});
  const Image a = Illuminate(scene, paths, field), b = Illuminate(scene, paths, light);
  EXPECT_GT(Mean(a), 0.1);
  for (size_t i = 0; i < a.pixels().size(); ++i)
    ASSERT_NEAR(a.pixels()[i], b.pixels()[i], 1e-4f * (1 + b.pixels()[i]));
}

// ---- Places

// Where in the picture, in pixels, a point is seen.
Eigen::Vector2d Project(const CameraGeometry& camera, int size, const Vec3& point) {
  const ViewFrame frame = CameraFrame(camera);
  const Vec3 d = point - frame.position;
  const double scale =
      size / 2.0 / std::tan(camera.field_of_view.radians() / 2) / d.dot(frame.forward);
  return {size / 2.0 + scale * d.dot(frame.right), size / 2.0 + scale * d.dot(frame.down)};
}

// Where a mirror ball of radius `radius` around the origin shows a point: where its normal halves the angle between the point and the
// camera. Searched for by bisection between the two, in the plane that they span with the ball's middle.
Vec3 MirroredAt(const Vec3& camera, const Vec3& at, double radius) {
  const Vec3 to_camera = camera.normalized(),
             side = (at - at.dot(to_camera) * to_camera).normalized();
  auto normal = [&](double angle) {
    return Vec3(std::cos(angle) * to_camera + std::sin(angle) * side);
  };
  double low = 0, high = std::acos(at.normalized().dot(to_camera));
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    const Vec3 n = normal(middle), point = radius * n;
    // Nearer to the camera the normal leans towards it.
    (n.dot((camera - point).normalized()) > n.dot((at - point).normalized()) ? low : high) = middle;
  }
  return radius * normal(low);
}

TEST(MirrorBall, ShowsEveryLampWhereTheNormalHalvesTheAngle) {
  constexpr int kSize = 64;
  constexpr double kRadius = 0.1, kLampRadius = 0.02;
  RigGeometry rig = OneLamp(Vec3(0.3, -0.9, 0.5), Vec3::Zero(), kLampRadius);
  rig.camera.field_of_view = Degrees(1);
  rig.brace.lamps = {{Degrees(0), Degrees(5)},
                     {Degrees(0), Degrees(40)},
                     {Degrees(0), Degrees(85)},
                     {Degrees(180), Degrees(30)},
                     {Degrees(180), Degrees(60)}};
  const Scene scene = BuildScene({Sphere(Vec3f::Zero(), kRadius, 1024)},
                                 {{.kind = Material::Kind::kMirror, .specular = Rgb::Ones()}});
  const Angle azimuth = Degrees(-70);
  for (int lamp = 0; lamp < static_cast<int>(rig.brace.lamps.size()); ++lamp) {
    const Vec3 at = LampDirection(rig.brace.lamps[lamp], azimuth), across = at.unitOrthogonal();
    rig.camera.look_at = MirroredAt(rig.camera.position, at, kRadius);
    const Paths paths(scene, rig.camera, kSize, kSize, {.samples = 64});
    const Image image =
        Illuminate(scene, paths, LampLight(rig.brace, lamp, azimuth, kIntensity, 1));
    double sum = 0;
    Eigen::Vector2d seen(0, 0);
    float most = 0;
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        sum += image.at(x, y, 0);
        seen += image.at(x, y, 0) * Eigen::Vector2d(x + 0.5, y + 0.5);
        most = std::max(most, image.at(x, y, 0));
      }
    }
    ASSERT_GT(sum, 0) << lamp;
    seen /= sum;

    // The lamp's rim, mirrored, is a closed line; its area and centroid by the shoelace formula.
    std::vector<Eigen::Vector2d> rim;
    for (int i = 0; i < 256; ++i) {
      const double angle = 2 * kPi * i / 256;
      const Vec3 point =
          at + kLampRadius * (std::cos(angle) * across + std::sin(angle) * at.cross(across));
      rim.push_back(Project(rig.camera, kSize, MirroredAt(rig.camera.position, point, kRadius)));
    }
    double area = 0;
    Eigen::Vector2d centroid(0, 0);
    for (size_t i = 0; i < rim.size(); ++i) {
      const Eigen::Vector2d &p = rim[i], &q = rim[(i + 1) % rim.size()];
      const double cross = p.x() * q.y() - q.x() * p.y();
      area += cross / 2;
      centroid += cross / 6 * (p + q);
    }
    centroid /= area;
    EXPECT_LT((seen - centroid).norm(), 0.05) << "lamp " << lamp << ": seen at " << seen.transpose()
                                              << ", expected at " << centroid.transpose();
    // Inside it, all of the lamp's radiance, I/(πr²): the picture's sum over it is the area in pixels.
    const double radiance = kIntensity / (kPi * kLampRadius * kLampRadius);
    EXPECT_LE(most, 1.0001 * radiance) << lamp;
    EXPECT_NEAR(sum / radiance / std::abs(area), 1, 0.02) << lamp;
  }
}

Vec3 Refract(const Vec3& d, const Vec3& n, double ratio) {
  const double cosine = -d.dot(n);
  return ratio * d + (ratio * cosine - std::sqrt(1 - ratio * ratio * (1 - cosine * cosine))) * n;
}

double FresnelReflectance(double incident, double n1, double n2) {
  const double refracted = std::asin(n1 / n2 * std::sin(incident));
  if (incident < 1e-6) return std::pow((n1 - n2) / (n1 + n2), 2);
  const double s = std::sin(incident - refracted) / std::sin(incident + refracted);
  const double p = std::tan(incident - refracted) / std::tan(incident + refracted);
  return (s * s + p * p) / 2;
}

// A glass ball shows, of what is around it, what is mirrored once and what is refracted twice (rays against a sphere, Snell's law,
// Fresnel's equations in their form with angles).
TEST(GlassBall, ShowsWhatIsMirroredOnceAndRefractedTwice) {
  constexpr int kSize = 32;
  constexpr double kRadius = 0.1, kIndex = 1.5;
  Image map(2048, 1024, 1);
  for (int y = 0; y < map.height(); ++y) {
    for (int x = 0; x < map.width(); ++x) {
      const Vec3 d = DirectionFromAngles(Degrees(180 - 360 * (x + 0.5) / map.width()),
                                         Degrees(180 * (y + 0.5) / map.height()));
      map.at(x, y, 0) = static_cast<float>(2 + d.z() + 0.5 * d.x() + 0.3 * d.y());
    }
  }
  auto radiance = [](const Vec3& d) { return 2 + d.z() + 0.5 * d.x() + 0.3 * d.y(); };
  const EnvironmentLight light(*EnvironmentMap::FromImage(std::move(map)), Degrees(0));
  const CameraGeometry camera{Vec3(0.3, -1, 0.4), Vec3::Zero(), Degrees(12)};
  const Scene scene = BuildScene({Sphere(Vec3f::Zero(), kRadius, 1024)},
                                 {{.kind = Material::Kind::kGlass, .ior = kIndex}});
  const Paths paths(scene, camera, kSize, kSize, {.samples = 512, .bounces = 1});
  const Image image = Illuminate(scene, paths, light);
  const ViewFrame frame = CameraFrame(camera);
  const double tan = std::tan(camera.field_of_view.radians() / 2);
  int compared = 0;
  double worst = 0, difference = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      double expected = 0;
      bool inside = true;
      constexpr int kFine = 8;  // the pixel's mean
      for (int i = 0; i < kFine * kFine; ++i) {
        const double px = x + (i % kFine + 0.5) / kFine, py = y + (i / kFine + 0.5) / kFine;
        const Vec3 d = (frame.forward + (px / kSize * 2 - 1) * tan * frame.right +
                        (py / kSize * 2 - 1) * tan * frame.down)
                           .normalized();
        const double b = frame.position.dot(d),
                     c = frame.position.squaredNorm() - kRadius * kRadius;
        if (b * b - c <
            0.2 * kRadius * kRadius) {  // not at the rim, where the pixel's mean is hard
          inside = false;
          break;
        }
        const Vec3 enter = frame.position + (-b - std::sqrt(b * b - c)) * d, n = enter / kRadius;
        const Vec3 within = Refract(d, n, 1 / kIndex);
        const Vec3 leave = enter - 2 * enter.dot(within) * within,
                   out = Refract(within, -leave / kRadius, kIndex);
        const double f = FresnelReflectance(std::acos(-d.dot(n)), 1, kIndex);
        expected += f * radiance(d - 2 * d.dot(n) * n) + (1 - f) * (1 - f) * radiance(out);
      }
      if (!inside) continue;
      expected /= 64;
      ++compared;
      difference += image.at(x, y, 0) / expected - 1;
      worst = std::max(worst, std::abs(image.at(x, y, 0) / expected - 1));
    }
  }
  EXPECT_GT(compared, 300);
  EXPECT_LT(worst, 0.05) << "Monte Carlo error of 512 samples";
  EXPECT_NEAR(difference / compared, 0, 1e-3);
}

}  // namespace
}  // namespace lightstage::sim
