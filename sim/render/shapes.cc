#include "sim/render/shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace lightstage::sim {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

void AverageNormals(Mesh* mesh) {
  mesh->normals.assign(mesh->vertices.size(), Vec3f::Zero());
  for (const auto& t : mesh->triangles) {
    const Vec3f& a = mesh->vertices[t[0]];
    // Twice the area times the unit normal: larger triangles count more.
    Vec3f weighted = (mesh->vertices[t[1]] - a).cross(mesh->vertices[t[2]] - a);
    for (uint32_t v : t) mesh->normals[v] += weighted;
  }
  for (Vec3f& n : mesh->normals) n.normalize();
}

bool Coincide(const Mesh& mesh, uint32_t a, uint32_t b) {
  return (mesh.vertices[a] - mesh.vertices[b]).norm() < 1e-7f;
}

// One flat quad, counterclockwise from outside.
void AddQuad(Mesh* mesh, const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d) {
  auto first = static_cast<uint32_t>(mesh->vertices.size());
  Vec3f normal = (c - a).cross(d - b).normalized();
  for (const Vec3f& v : {a, b, c, d}) {
    mesh->vertices.push_back(v);
    mesh->normals.push_back(normal);
  }
  mesh->triangles.push_back({first, first + 1, first + 2});
  mesh->triangles.push_back({first, first + 2, first + 3});
}

// Catmull and Rom's curve through the points between `points[k]` and the next one.
template <typename Vector>
Vector Between(const std::vector<Vector>& points, size_t k, float t) {
  const size_t last = points.size() - 1;
  const Vector &b = points[k], &c = points[std::min(k + 1, last)];
  // The ends, and points given twice, are corners.
  Vector a = k > 0 ? points[k - 1] : b, d = points[std::min(k + 2, last)];
  return b + 0.5f * t * ((c - a) + t * ((2 * a - 5 * b + 4 * c - d) + t * (3 * (b - c) + d - a)));
}

}  // namespace

Mesh Surface(int columns, int rows, bool wrap_s, bool wrap_t,
             const std::function<Vec3f(float, float)>& point) {
  const int across = wrap_s ? columns : columns + 1, up = wrap_t ? rows : rows + 1;
  Mesh mesh;
  for (int j = 0; j < up; ++j) {
    for (int i = 0; i < across; ++i) {
      mesh.vertices.push_back(point(static_cast<float>(i) / columns, static_cast<float>(j) / rows));
    }
  }
  // At a pole a row is one point, to the last bit: a closed surface has no hole there.
  for (int j = 0; j < up; ++j) {
    for (int i = 1; i < across; ++i) {
      const auto v = static_cast<uint32_t>(j * across + i);
      if (Coincide(mesh, v - 1, v)) mesh.vertices[v] = mesh.vertices[v - 1];
    }
  }
  auto index = [&](int i, int j) { return static_cast<uint32_t>((j % up) * across + i % across); };
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      uint32_t a = index(i, j), b = index(i + 1, j), c = index(i + 1, j + 1), d = index(i, j + 1);
      // There a side has no length, and a triangle on it no area: no face, and no normal to speak of.
      if (!Coincide(mesh, a, b)) mesh.triangles.push_back({a, b, c});
      if (!Coincide(mesh, c, d)) mesh.triangles.push_back({a, c, d});
    }
  }
  AverageNormals(&mesh);
  return mesh;
}

Mesh Sphere(const Vec3f& center, float radius, int segments) {
  Mesh mesh = Surface(segments, segments / 2, true, false, [&](float s, float t) {
    float azimuth = 2 * kPi * s, height = kPi * (t - 0.5f);
    return Vec3f(center + radius * Vec3f(std::cos(height) * std::cos(azimuth),
                                         std::cos(height) * std::sin(azimuth), std::sin(height)));
  });
  // The exact normals, also at the poles where triangles have no area.
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    mesh.normals[i] = (mesh.vertices[i] - center).normalized();
  }
  return mesh;
}

Mesh Blob(const Vec3f& center, const Vec3f& radii, int segments,
          const std::function<float(const Vec3f&)>& bulge) {
  return Surface(segments, segments / 2, true, false, [&](float s, float t) {
    float azimuth = 2 * kPi * s, height = kPi * (t - 0.5f);
    // To the last bit at the poles, where a bulge may tell azimuths apart.
    float c = t == 0 || t == 1 ? 0 : std::cos(height);
    Vec3f direction(c * std::cos(azimuth), c * std::sin(azimuth), std::sin(height));
    return Vec3f(center + (bulge ? bulge(direction) : 1) * radii.cwiseProduct(direction));
  });
}

Mesh Torus(const Vec3f& center, float major, float minor, int segments, int sides) {
  return Surface(segments, sides, true, true, [&](float s, float t) {
    float azimuth = 2 * kPi * s, angle = 2 * kPi * t, r = major + minor * std::cos(angle);
    return Vec3f(center +
                 Vec3f(r * std::cos(azimuth), r * std::sin(azimuth), minor * std::sin(angle)));
  });
}

Mesh Box(const Vec3f& center, const Vec3f& half, float yaw) {
  Mesh mesh;
  auto corner = [&](float x, float y, float z) {
    Vec3f p(x * half.x(), y * half.y(), z * half.z());
    return Vec3f(center + Vec3f(std::cos(yaw) * p.x() - std::sin(yaw) * p.y(),
                                std::sin(yaw) * p.x() + std::cos(yaw) * p.y(), p.z()));
  };
  AddQuad(&mesh, corner(-1, -1, 1), corner(1, -1, 1), corner(1, 1, 1), corner(-1, 1, 1));
  AddQuad(&mesh, corner(-1, 1, -1), corner(1, 1, -1), corner(1, -1, -1), corner(-1, -1, -1));
  AddQuad(&mesh, corner(-1, -1, -1), corner(1, -1, -1), corner(1, -1, 1), corner(-1, -1, 1));
  AddQuad(&mesh, corner(1, 1, -1), corner(-1, 1, -1), corner(-1, 1, 1), corner(1, 1, 1));
  AddQuad(&mesh, corner(1, -1, -1), corner(1, 1, -1), corner(1, 1, 1), corner(1, -1, 1));
  AddQuad(&mesh, corner(-1, 1, -1), corner(-1, -1, -1), corner(-1, -1, 1), corner(-1, 1, 1));
  return mesh;
}

Mesh Lathe(const Vec3f& base, const std::vector<Eigen::Vector2f>& profile, int segments) {
  std::vector<Eigen::Vector2f> closed = profile;
  if (closed.front().x() > 0) closed.insert(closed.begin(), {0.0f, closed.front().y()});
  if (closed.back().x() > 0) closed.push_back({0.0f, closed.back().y()});
  Mesh mesh;
  for (size_t k = 0; k + 1 < closed.size(); ++k) {
    const Eigen::Vector2f along = (closed[k + 1] - closed[k]).normalized();
    // Each ring has its own vertices: smooth around, creased between rings.
    auto first = static_cast<uint32_t>(mesh.vertices.size());
    for (int i = 0; i < segments; ++i) {
      float azimuth = 2 * kPi * static_cast<float>(i) / static_cast<float>(segments);
      float c = std::cos(azimuth), s = std::sin(azimuth);
      for (size_t e = k; e <= k + 1; ++e) {
        mesh.vertices.push_back(base + Vec3f(closed[e].x() * c, closed[e].x() * s, closed[e].y()));
        mesh.normals.push_back(Vec3f(along.y() * c, along.y() * s, -along.x()));
      }
    }
    for (int i = 0; i < segments; ++i) {
      uint32_t a = first + 2 * i, b = first + 2 * ((i + 1) % segments);
      if (closed[k].x() > 0) mesh.triangles.push_back({a, b, b + 1});
      if (closed[k + 1].x() > 0) mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return mesh;
}

std::vector<Vec2f> Rounded(const std::vector<Vec2f>& profile, int steps) {
  std::vector<Vec2f> fine = {profile.front()};
  for (size_t k = 0; k + 1 < profile.size(); ++k) {
    if (profile[k] == profile[k + 1]) continue;
    for (int i = 1; i <= steps; ++i) {
      fine.push_back(Between(profile, k, static_cast<float>(i) / static_cast<float>(steps)));
      fine.back().x() = std::max(fine.back().x(), 0.0f);
    }
  }
  return fine;
}

Mesh Loft(const std::vector<Section>& sections, int sides, int steps, float squareness,
          const std::function<Vec3f(const Vec3f&)>& press) {
  std::vector<Vec3f> centers, across, up;
  for (const Section& section : sections) {
    centers.push_back(section.center);
    across.push_back(section.across);
    up.push_back(section.up);
  }
  const int rows = static_cast<int>(sections.size() - 1) * steps;
  // A row before the first and one after the last close the ends.
  return Surface(sides, rows + 2, true, false, [&](float s, float t) {
    int row = static_cast<int>(std::lround(t * static_cast<float>(rows + 2))) - 1;
    int along = std::clamp(row, 0, rows);
    auto k = static_cast<size_t>(along / steps);
    float f = static_cast<float>(along % steps) / static_cast<float>(steps);
    Vec3f center = Between(centers, k, f);
    if (row != along) return center;
    auto bent = [&](float v) { return std::copysign(std::pow(std::abs(v), 2 / squareness), v); };
    Vec3f p = center + bent(std::cos(2 * kPi * s)) * Between(across, k, f) +
              bent(std::sin(2 * kPi * s)) * Between(up, k, f);
    return press ? press(p) : p;
  });
}

std::vector<Section> Rope(const std::vector<Vec3f>& points, float radius, const Vec3f& across) {
  std::vector<Section> sections;
  const size_t last = points.size() - 1;
  for (size_t i = 0; i <= last; ++i) {
    Vec3f along = (points[std::min(i + 1, last)] - points[i > 0 ? i - 1 : 0]).normalized();
    Vec3f up = along.cross(across).normalized();
    sections.push_back({points[i], radius * up.cross(along), radius * up});
  }
  return sections;
}

Mesh Tube(const std::function<Vec3f(float)>& curve, float radius, int segments, int sides) {
  // A frame carried along the curve without twisting, its remaining turn spread over the length so that the ends meet.
  std::vector<Vec3f> centers(segments + 1), tangents(segments + 1), normals(segments + 1);
  for (int i = 0; i <= segments; ++i) {
    float s = static_cast<float>(i % segments) / static_cast<float>(segments);
    const float h = 0.25f / static_cast<float>(segments);
    centers[i] = curve(s);
    tangents[i] = (curve(s + h) - curve(s - h)).normalized();
  }
  normals[0] = tangents[0].unitOrthogonal();
  for (int i = 1; i <= segments; ++i) {
    normals[i] = (normals[i - 1] - tangents[i].dot(normals[i - 1]) * tangents[i]).normalized();
  }
  Vec3f across = tangents[0].cross(normals[0]);
  float turn = std::atan2(normals[segments].dot(across), normals[segments].dot(normals[0]));
  return Surface(sides, segments, true, true, [&](float s, float t) {
    int i = static_cast<int>(std::lround(t * static_cast<float>(segments)));
    float angle = 2 * kPi * s - turn * t;
    Vec3f side = tangents[i].cross(normals[i]);
    return Vec3f(centers[i] + radius * (std::cos(angle) * normals[i] + std::sin(angle) * side));
  });
}

Mesh Rod(const Vec3f& from, const Vec3f& to, float radius, int sides) {
  const Vec3f along = to - from;
  Eigen::Affine3f transform(Eigen::Quaternionf::FromTwoVectors(Vec3f::UnitZ(), along));
  transform.pretranslate(from);
  return Transformed(Lathe(Vec3f::Zero(), {{radius, 0.0f}, {radius, along.norm()}}, sides),
                     transform);
}

Mesh Transformed(Mesh mesh, const Eigen::Affine3f& transform) {
  for (Vec3f& v : mesh.vertices) v = transform * v;
  for (Vec3f& n : mesh.normals) n = (transform.linear() * n).normalized();
  return mesh;
}

Mesh InsideOut(Mesh mesh) {
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  for (Vec3f& n : mesh.normals) n = -n;
  return mesh;
}

Mesh Joined(const std::vector<Mesh>& parts) {
  Mesh all;
  for (const Mesh& part : parts) {
    const auto first = static_cast<uint32_t>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
    all.normals.insert(all.normals.end(), part.normals.begin(), part.normals.end());
    for (const auto& t : part.triangles) {
      all.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    }
  }
  return all;
}

Mesh Floor(float half_width, float z) {
  Mesh mesh;
  const float w = half_width;
  AddQuad(&mesh, {-w, -w, z}, {w, -w, z}, {w, w, z}, {-w, w, z});
  return mesh;
}

}  // namespace lightstage::sim
