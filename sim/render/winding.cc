#include "sim/render/winding.h"

#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>

#include "absl/container/flat_hash_map.h"

namespace lightstage::sim {
namespace {

// Of a triangle, seen from a point (van Oosterom and Strackee, 1983).
double SolidAngle(const Mesh& mesh, uint32_t triangle, const Eigen::Vector3d& point) {
  const auto& t = mesh.triangles[triangle];
  const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>() - point,
                        b = mesh.vertices[t[1]].cast<double>() - point,
                        c = mesh.vertices[t[2]].cast<double>() - point;
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)),
                        la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

double WindingNumber(const Mesh& mesh, const Eigen::Vector3d& point) {
  double sum = 0;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) sum += SolidAngle(mesh, t, point);
  return sum / (4 * std::numbers::pi);
}

std::vector<uint32_t> Places(const Mesh& mesh) {
  using Place = std::array<uint32_t, 3>;
  absl::flat_hash_map<Place, uint32_t> places;
  std::vector<uint32_t> out;
  out.reserve(mesh.vertices.size());
  for (const Vec3f& v : mesh.vertices) {
    Place place;
    for (int c = 0; c < 3; ++c) place[c] = std::bit_cast<uint32_t>(v[c] + 0.0f);  // −0 becomes 0
    out.push_back(places.try_emplace(place, static_cast<uint32_t>(places.size())).first->second);
  }
  return out;
}

Shells::Shells(const Mesh& mesh) : mesh_(mesh), places_(Places(mesh)), of_(mesh.triangles.size()) {
  // Places that triangles join, as a forest: each leads to another one of its shell, at last to itself.
  std::vector<uint32_t> next(places_.size());
  std::iota(next.begin(), next.end(), 0);
  auto root = [&](uint32_t place) {
    while (next[place] != place) place = next[place] = next[next[place]];
    return place;
  };
  for (const auto& t : mesh.triangles) {
    for (uint32_t v : t) next[root(places_[v])] = root(places_[t[0]]);
  }
  absl::flat_hash_map<uint32_t, uint32_t> numbers;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [it, is_new] = numbers.try_emplace(root(places_[mesh.triangles[t][0]]),
                                                  static_cast<uint32_t>(shells_.size()));
    if (is_new) shells_.emplace_back();
    of_[t] = it->second;
    Shell& shell = shells_[it->second];
    shell.triangles.push_back(t);
    for (uint32_t v : mesh.triangles[t]) shell.box.extend(mesh.vertices[v].cast<double>());
  }
}

int Shells::WindingNumber(const Eigen::Vector3d& point) const {
  double sum = 0;
  for (const Shell& shell : shells_) {
    if (!shell.box.contains(point)) continue;
    for (uint32_t t : shell.triangles) sum += SolidAngle(mesh_, t, point);
  }
  return static_cast<int>(std::lround(sum / (4 * std::numbers::pi)));
}

}  // namespace lightstage::sim
