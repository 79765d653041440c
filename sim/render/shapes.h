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

// A box with its axes turned by `yaw` radians about Z.
Mesh Box(const Vec3f& center, const Vec3f& half, float yaw = 0);

// A solid of revolution about a vertical axis through `base`. `profile`: (radius, height) from bottom to top, of flat-shaded
// rings; the ends are closed if their radius is not 0.
Mesh Lathe(const Vec3f& base, const std::vector<Eigen::Vector2f>& profile, int segments = 192);

// A tube of `radius` along a closed curve over [0,1).
Mesh Tube(const std::function<Vec3f(float)>& curve, float radius, int segments, int sides);

// A cylinder with flat ends.
Mesh Rod(const Vec3f& from, const Vec3f& to, float radius, int sides = 16);

// Turned, moved and scaled (a similarity).
Mesh Transformed(Mesh mesh, const Eigen::Affine3f& transform);

// One upward rectangle around (0, 0, z).
Mesh Floor(float half_width, float z);

}  // namespace lightstage::sim
