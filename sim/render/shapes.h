// Closed meshes from formulas, for procedural scenes. Metres, object frame; the caller sets the material.
#pragma once

#include <functional>
#include <vector>

#include "sim/render/scene.h"

namespace lightstage::sim {

// A smooth surface over [0,1]²: `columns`×`rows` quads of point(s, t), seen from outside with s to the right and t up. A wrapped
// side is sewn to its opposite one. Normals are averaged over the triangles around a vertex.
Mesh Surface(int columns, int rows, bool wrap_s, bool wrap_t,
             const std::function<Vec3f(float s, float t)>& point);

Mesh Sphere(const Vec3f& center, float radius, int segments = 128);

// An ellipsoid; with `bulge`, every point's distance from the center is multiplied by what that gives for the unit direction
// before `radii` stretch it.
Mesh Blob(const Vec3f& center, const Vec3f& radii, int segments,
          const std::function<float(const Vec3f& direction)>& bulge = nullptr);

// A ring around a vertical axis. `minor`: the radius of what is bent to a ring.
Mesh Torus(const Vec3f& center, float major, float minor, int segments = 160, int sides = 40);

// A box with its axes turned by `yaw` radians about Z.
Mesh Box(const Vec3f& center, const Vec3f& half, float yaw = 0);

// A solid of revolution about a vertical axis through `base`. `profile`: (radius, height) from bottom to top, of flat-shaded
// rings; the ends are closed if their radius is not 0.
Mesh Lathe(const Vec3f& base, const std::vector<Eigen::Vector2f>& profile, int segments = 192);

// A profile for Lathe with `steps` to each span, on a smooth curve through the points. A point given twice stays a corner.
std::vector<Vec2f> Rounded(const std::vector<Vec2f>& profile, int steps);

// An ellipse with the half axes `across` and `up`; the way through the sections goes along their cross product.
struct Section {
  Vec3f center, across, up;
};
// A body through ellipses, smooth along, with `steps` to each span. Its ends close flat. `squareness` 2 is an ellipse; more goes
// towards a rectangle. `press` moves what comes out.
Mesh Loft(const std::vector<Section>& sections, int sides, int steps, float squareness = 2,
          const std::function<Vec3f(const Vec3f&)>& press = nullptr);

// Sections of a rope through points, across which `across` lies as far as it can.
std::vector<Section> Rope(const std::vector<Vec3f>& points, float radius, const Vec3f& across);

// A tube of `radius` along a closed curve over [0,1).
Mesh Tube(const std::function<Vec3f(float)>& curve, float radius, int segments, int sides);

// A cylinder with flat ends.
Mesh Rod(const Vec3f& from, const Vec3f& to, float radius, int sides = 16);

// Turned, moved and scaled (a similarity).
Mesh Transformed(Mesh mesh, const Eigen::Affine3f& transform);

// With its inner side seen.
Mesh InsideOut(Mesh mesh);

// Parts put into one mesh, for a shape that is placed many times. None of them has UVs or placements.
Mesh Joined(const std::vector<Mesh>& parts);

// One upward rectangle around (0, 0, z).
Mesh Floor(float half_width, float z);

}  // namespace lightstage::sim
