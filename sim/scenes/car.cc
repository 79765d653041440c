#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>
#include <vector>

#include "sim/scenes/builder.h"
#include "sim/scenes/shipped.h"

namespace lightstage::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// The car's own frame: X forward, Y to its left, the road at z = 0.
Eigen::Affine3f CarPose() {
  return Eigen::Affine3f(Eigen::Translation3f(-0.002f, 0.034f, 0) *
                         Eigen::AngleAxisf(-0.82f, Vec3f::UnitZ()) *
                         Eigen::UniformScaling<float>(1.16f));
}

// How far along and to the side of the cockpit's middle, 1 at its edge.
float Cockpit(const Vec3f& p) { return std::hypot((p.x() + 0.020f) / 0.031f, p.y() / 0.0205f); }

// What is pressed into the sheet metal: the cockpit, a scuttle before it, and louvres over the engine.
Vec3f PressBody(const Vec3f& p) {
  Vec3f out = p;
  if (p.z() < 0.055f) return out;
  const float scuttle = std::hypot((p.x() - 0.022f) / 0.022f, p.y() / 0.020f);
  out.z() += 0.007f * std::exp(-scuttle * scuttle);
  const float inside = std::clamp((1 - Cockpit(p)) / 0.12f, 0.0f, 1.0f);
  out.z() -= inside * (out.z() - 0.050f);
  const float side = std::abs(p.y());
  if (p.x() > 0.036f && p.x() < 0.084f && side > 0.010f && side < 0.021f) {
    // Ramps that open backwards.
    float ramp = (p.x() - 0.036f) / 0.006f;
    ramp = 1 - (ramp - std::floor(ramp));
    const float ends = std::min({1.0f, (side - 0.010f) / 0.0015f, (0.021f - side) / 0.0015f});
    out.z() += 0.0022f * ends * std::max(0.0f, ramp - 0.2f);
  }
  return out;
}

bool Seven(float x, float y) {
  if (std::abs(x) < 0.0050f && y > 0.0045f && y < 0.0070f) return true;
  return y < 0.0070f && y > -0.0070f && std::abs(x - 0.0050f + (0.0060f - y) * 0.5f) < 0.0014f;
}

Rgb Paint(const SurfacePoint& at) {
  const Vec3f p = CarPose().inverse() * at.position;
  Rgb white = Rgb::Constant(0.80f), black = Rgb::Constant(0.02f), red(0.50f, 0.012f, 0.015f);
  if (p.z() > 0.049f && p.z() < 0.075f && Cockpit(p) < 0.97f) return black;
  // A white ring around the mouth, and a number on the nose.
  if (p.x() > 0.1315f) return white;
  const float top = std::hypot(p.x() - 0.1f, p.y());
  if (p.z() > 0.045f && top < 0.0115f) {
    // Read from before the car.
    return Seven(1.1f * p.y(), 1.1f * (0.1f - p.x())) ? black : white;
  }
  return red;
}

Mesh Body() {
  struct Rib {
    float x, half_width, half_height, z;
  };
  // From within the mouth around its lip and back to the tail.
  constexpr Rib kRibs[] = {
      {0.116f, 0.0120f, 0.0090f, 0.0400f},  {0.128f, 0.0140f, 0.0105f, 0.0400f},
      {0.1365f, 0.0165f, 0.0125f, 0.0400f}, {0.135f, 0.0190f, 0.0150f, 0.0403f},
      {0.120f, 0.0232f, 0.0195f, 0.0415f},  {0.085f, 0.0290f, 0.0255f, 0.0440f},
      {0.040f, 0.0340f, 0.0300f, 0.0480f},  {0.000f, 0.0365f, 0.0325f, 0.0500f},
      {-0.040f, 0.0360f, 0.0320f, 0.0500f}, {-0.080f, 0.0310f, 0.0280f, 0.0490f},
      {-0.110f, 0.0225f, 0.0210f, 0.0490f}, {-0.132f, 0.0110f, 0.0110f, 0.0490f},
      {-0.138f, 0.0030f, 0.0030f, 0.0490f}};
  std::vector<Section> sections;
  for (const Rib& rib : kRibs) {
    sections.push_back({{rib.x, 0, rib.z}, {0, -rib.half_width, 0}, {0, 0, rib.half_height}});
  }
  return Loft(sections, 256, 36, 2.15f, PressBody);
}

// About the Z axis, of radius 30 mm, its outer side up.
Mesh Tyre() {
  return Surface(640, 96, true, true, [](float s, float t) {
    const float azimuth = 2 * kPi * s, angle = 2 * kPi * t;
    auto bent = [](float v) { return std::copysign(std::pow(std::abs(v), 0.7f), v); };
    float out = 0.0085f * bent(std::cos(angle)), z = 0.0110f * bent(std::sin(angle));
    if (out > 0.0045f) {
      // Three grooves around, and cuts from the outer two to the shoulders.
      const float row = std::abs(z) / 0.0110f;
      const float cut = 52 * s + 0.5f * row + (z > 0 ? 0.5f : 0.0f);
      const bool groove = row < 0.07f || std::abs(row - 0.48f) < 0.07f ||
                          (row > 0.48f && cut - std::floor(cut) < 0.26f);
      if (groove) out -= 0.0013f;
    } else if (out > 0.0010f && out < 0.0022f) {
      z *= 1.04f;  // a rib on the wall
    }
    const float r = 0.0215f + out;
    return Vec3f(r * std::cos(azimuth), r * std::sin(azimuth), z);
  });
}

// A deep dish with wire spokes, to go into the tyre.
Mesh Rim() {
  std::vector<Mesh> parts = {Lathe(Vec3f::Zero(),
                                   {{0.0143f, -0.0085f},
                                    {0.0143f, 0.0098f},
                                    {0.0132f, 0.0098f},
                                    {0.0126f, 0.0080f},
                                    {0.0122f, -0.0050f}},
                                   128),
                             Lathe(Vec3f::Zero(),
                                   Rounded({{0.0030f, -0.0050f},
                                            {0.0030f, 0.0060f},
                                            {0.0030f, 0.0060f},
                                            {0.0036f, 0.0066f},
                                            {0.0034f, 0.0080f},
                                            {0.0015f, 0.0092f},
                                            {0.0f, 0.0094f}},
                                           5),
                                   48)};
  constexpr int kSpokes = 36;
  for (int i = 0; i < kSpokes; ++i) {
    // Crossed: every second one leans the other way, and starts lower.
    const float lean = i % 2 == 0 ? 0.35f : -0.35f, low = i % 2 == 0 ? 0.0015f : 0.0055f;
    const float a = 2 * kPi * static_cast<float>(i) / kSpokes;
    parts.push_back(Rod({0.0026f * std::cos(a + lean), 0.0026f * std::sin(a + lean), low},
                        {0.0128f * std::cos(a), 0.0128f * std::sin(a), 0.0030f}, 0.00038f, 8));
  }
  // The knock-off nut.
  for (int i = 0; i < 2; ++i) {
    parts.push_back(
        Box({0, 0, 0.0093f}, {0.0052f, 0.0010f, 0.0008f}, kPi * static_cast<float>(i) / 2));
  }
  return Joined(parts);
}

// A spring around the way from one point to the other.
Mesh Coil(const Vec3f& from, const Vec3f& to) {
  constexpr int kTurns = 7, kPoints = 16 * kTurns;
  const Vec3f along = to - from;
  const Vec3f u = along.unitOrthogonal(), v = along.normalized().cross(u);
  std::vector<Vec3f> points;
  for (int i = 0; i <= kPoints; ++i) {
    const float s = static_cast<float>(i) / kPoints, a = 2 * kPi * kTurns * s;
    points.emplace_back(from + s * along + 0.0042f * (std::cos(a) * u + std::sin(a) * v));
  }
  return Loft(Rope(points, 0.00085f, along.normalized()), 10, 1);
}

struct Paints {
  int steel, dull, black, spring;
};

// One corner's links between the body and a wheel at `hub`, on the side of its y.
void PutSuspension(const Vec3f& hub, float reach, const Paints& paints,
                   const std::function<void(Mesh, int)>& put) {
  const float side = hub.y() > 0 ? 1.0f : -1.0f;
  const float end = hub.y() - 0.013f * side;
  for (float high : {-1.0f, 1.0f}) {
    const Vec3f joint(hub.x(), end, hub.z() + 0.010f * high);
    for (float fore : {-1.0f, 1.0f}) {
      put(Rod({hub.x() + reach * fore, 0.018f * side, hub.z() + 0.006f + 0.012f * high}, joint,
              0.0014f, 16),
          paints.steel);
    }
    put(Blob(joint, Vec3f::Constant(0.0024f), 24), paints.steel);
  }
  put(Rod({hub.x(), end, hub.z() - 0.012f}, {hub.x(), end, hub.z() + 0.012f}, 0.0022f),
      paints.dull);
  put(Rod({hub.x(), 0, hub.z()}, {hub.x(), hub.y() - 0.005f * side, hub.z()}, 0.0028f),
      paints.dull);
  // A brake drum, a damper and its spring.
  put(Rod({hub.x(), end + 0.001f * side, hub.z()}, {hub.x(), end + 0.006f * side, hub.z()}, 0.0115f,
          64),
      paints.dull);
  const Vec3f low(hub.x(), end - 0.004f * side, hub.z() - 0.008f);
  const Vec3f up(hub.x(), 0.026f * side, hub.z() + 0.024f);
  put(Coil(low + 0.12f * (up - low), low + 0.88f * (up - low)), paints.spring);
  put(Rod(low, up, 0.0019f), paints.steel);
}

void PutDriver(const Paints& paints, Builder* b, const std::function<void(Mesh, int)>& put) {
  put(Blob({-0.034f, 0, 0.072f}, {0.011f, 0.0165f, 0.013f}, 64), b->Matte({0.05f, 0.10f, 0.28f}));
  const Vec3f head(-0.033f, 0, 0.0945f);
  put(Blob(head, {0.0128f, 0.0118f, 0.0128f}, 96), b->Plastic({0.78f, 0.76f, 0.70f}, 0.15f));
  put(Blob(head + Vec3f(0.0042f, 0, 0.0005f), {0.0100f, 0.0102f, 0.0042f}, 64), paints.black);
  // The steering wheel, and arms to it.
  Eigen::Affine3f wheel(Eigen::Translation3f(-0.006f, 0, 0.0790f) *
                        Eigen::AngleAxisf(-1.15f, Vec3f::UnitY()));
  put(Transformed(Torus(Vec3f::Zero(), 0.0085f, 0.0011f, 96, 24), wheel), paints.black);
  for (float side : {-1.0f, 1.0f}) {
    put(Rod({-0.032f, 0.014f * side, 0.076f}, {-0.008f, 0.0085f * side, 0.080f}, 0.0030f),
        b->Matte({0.05f, 0.10f, 0.28f}));
  }
}

}  // namespace

SceneDescription Car() {
  Builder b;
  PutGround(&b);
  const Eigen::Affine3f pose = CarPose();
  auto put = [&](Mesh mesh, int material) { b.Put(Transformed(std::move(mesh), pose), material); };
  const Paints paints = {.steel = b.Metal({0.72f, 0.71f, 0.69f}, 0.22f),
                         .dull = b.Metal({0.32f, 0.31f, 0.30f}, 0.35f),
                         .black = b.Plastic(Rgb::Constant(0.02f), 0.15f),
                         .spring = b.Plastic({0.60f, 0.42f, 0.03f}, 0.2f)};
  put(Body(), b.Add({.diffuse = Rgb::Ones(),
                     .specular = Rgb::Constant(0.05f),
                     .roughness = 0.06f,
                     .texture = Paint}));
  // The grille: bars before the dark.
  put(Rod({0.1150f, 0, 0.040f}, {0.1165f, 0, 0.040f}, 0.0110f, 48), b.Matte(Rgb::Constant(0.01f)));
  for (int i = -4; i <= 4; ++i) {
    const float y = 0.0028f * static_cast<float>(i), h = 0.0112f * std::sqrt(1 - y * y / 2.1e-4f);
    put(Rod({0.1290f, y, 0.040f - h}, {0.1290f, y, 0.040f + h}, 0.0007f, 12), paints.steel);
  }
  put(Rod({0.1285f, -0.0142f, 0.040f}, {0.1285f, 0.0142f, 0.040f}, 0.0007f, 12), paints.steel);

  // Wheels: what is made for 30 mm, larger behind.
  constexpr float kMade = 0.030f;
  Mesh tyre = Tyre(), rim = Rim();
  for (float side : {-1.0f, 1.0f}) {
    for (bool front : {true, false}) {
      const float radius = front ? 0.030f : 0.036f;
      const Vec3f hub(front ? 0.092f : -0.086f, side * (front ? 0.062f : 0.066f), radius);
      Eigen::Affine3f place(Eigen::Translation3f(hub) *
                            Eigen::AngleAxisf(-0.5f * kPi * side, Vec3f::UnitX()) *
                            Eigen::UniformScaling<float>(radius / kMade));
      tyre.placements.push_back(pose * place);
      rim.placements.push_back(pose * place);
      PutSuspension(hub, front ? 0.014f : 0.022f, paints, put);
    }
    // A radius rod to the rear axle, the steering's link, and a mirror on its stalk.
    put(Rod({-0.010f, 0.036f * side, 0.040f}, {-0.086f, 0.052f * side, 0.030f}, 0.0015f),
        paints.steel);
    put(Rod({0.078f, 0.020f * side, 0.038f}, {0.082f, 0.050f * side, 0.032f}, 0.0011f),
        paints.steel);
    put(Rod({0.012f, 0.024f * side, 0.074f}, {0.010f, 0.034f * side, 0.086f}, 0.0008f, 12),
        paints.steel);
    put(Blob({0.010f, 0.035f * side, 0.088f}, {0.0035f, 0.0060f, 0.0042f}, 48), paints.steel);
    // Four pipes from the engine into one, which ends behind the rear axle.
    for (int i = 0; i < 4; ++i) {
      const float x = 0.052f - 0.011f * static_cast<float>(i);
      put(Loft(Rope({{x, 0.028f * side, 0.060f},
                     {x - 0.002f, 0.038f * side, 0.061f},
                     {x - 0.008f, 0.0435f * side, 0.059f},
                     {x - 0.018f, 0.0445f * side, 0.058f}},
                    0.0026f, Vec3f::UnitZ()),
               20, 6),
          paints.steel);
    }
    put(Loft(Rope({{0.034f, 0.0445f * side, 0.058f},
                   {0.000f, 0.0450f * side, 0.058f},
                   {-0.060f, 0.0430f * side, 0.060f},
                   {-0.105f, 0.0400f * side, 0.064f},
                   {-0.150f, 0.0390f * side, 0.064f}},
                  0.0040f, Vec3f::UnitZ()),
             32, 12),
        paints.steel);
    put(Rod({-0.1495f, 0.0390f * side, 0.064f}, {-0.1502f, 0.0390f * side, 0.064f}, 0.0034f, 32),
        paints.black);
  }
  b.Put(std::move(tyre), b.Matte(Rgb::Constant(0.035f)));
  b.Put(std::move(rim), paints.steel);
  // A head fairing, and the filler's cap before the cockpit.
  put(Blob({-0.072f, 0, 0.074f}, {0.034f, 0.0125f, 0.0160f}, 96),
      b.Plastic({0.50f, 0.012f, 0.015f}, 0.06f));
  put(Rod({0.060f, 0, 0.070f}, {0.060f, 0, 0.0785f}, 0.0055f, 48), paints.steel);
  PutDriver(paints, &b, put);
  return b.Take();
}

}  // namespace lightstage::sim
