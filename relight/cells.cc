#include "relight/cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <nanoflann.hpp>
#include <numbers>

#include "base/status.h"
#include "relight/parallel.h"

namespace lightstage::relight {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kSameDirection = 1e-6;  // rad
// −z from which a direction counts as below the horizon: 0.1°. Directions come from reported poses, and an axis sent to the horizon may
// report a little below it.
constexpr double kHorizon = 1.75e-3;
// Where two cells meet, a piece of a texel is split along their bisector once its radius is this share of the lights' distances: the
// bisector is straight enough then. Where more cells meet, pieces are halved down to the second share.
constexpr double kEdgeLeaf = 0.1;
constexpr double kVertexLeaf = 0.007;
// Larger pieces are too curved to be treated as flat boxes.
constexpr double kFlat = 0.01;
// Rivals of the nearest light that are looked at one by one.
constexpr size_t kNeighbours = 8;
constexpr int kMaxDepth = 24;

struct Points {
  std::vector<Vec3> at;
  size_t kdtree_get_point_count() const { return at.size(); }
  double kdtree_get_pt(size_t i, size_t axis) const { return at[i][axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Points>,
                                                 Points, 3, uint32_t>;

double AngleOfChord(double chord) { return 2 * std::asin(std::min(1.0, chord / 2)); }

// Distinct directions, and for each of the given ones which it is.
struct Sites {
  Points points;
  std::vector<uint32_t> site_of;
  std::vector<int> members;  // how many of the given directions are this one
};

Sites Merge(const std::vector<Vec3>& directions, Angle rotate) {
  // The map turned by +rotate over the lights is the map as it is over lights turned by −rotate.
  Points all;
  for (const Vec3& d : directions) all.at.push_back(RotateAboutZ(d.normalized(), -rotate));
  Tree tree(3, all);
  Sites sites;
  constexpr uint32_t kUnset = ~0u;
  sites.site_of.assign(directions.size(), kUnset);
  std::vector<std::pair<uint32_t, double>> near;
  for (size_t i = 0; i < directions.size(); ++i) {
    if (sites.site_of[i] != kUnset) continue;
    const uint32_t site = static_cast<uint32_t>(sites.points.at.size());
    sites.points.at.push_back(all.at[i]);
    sites.members.push_back(0);
    tree.radiusSearch(all.at[i].data(), kSameDirection * kSameDirection, near, {});
    for (const auto& [j, distance] : near) {
      if (sites.site_of[j] != kUnset) continue;
      sites.site_of[j] = site;
      ++sites.members[site];
    }
  }
  return sites;
}

// A piece of a texel, in radians. `cos0 − cos1` times its azimuth width is its exact solid angle, so halves add up to the whole.
struct Piece {
  double azimuth, tilt;            // of the centre
  double half_azimuth, half_tilt;  // half widths

  Vec3 Centre() const {
    double s = std::sin(tilt);
    return {s * std::cos(azimuth), s * std::sin(azimuth), std::cos(tilt)};
  }
  double SolidAngle() const {
    // cos(a−h) − cos(a+h) without cancellation.
    return 2 * half_azimuth * 2 * std::sin(tilt) * std::sin(half_tilt);
  }
  // An upper bound of the chord from the centre to any point of the piece (haversine).
  double Radius() const {
    const double low = tilt - half_tilt, high = tilt + half_tilt;
    const double widest =
        low <= kPi / 2 && high >= kPi / 2 ? 1 : std::max(std::sin(low), std::sin(high));
    const double a = std::sin(half_tilt / 2);
    const double b = half_azimuth >= kPi ? 1 : std::sin(half_azimuth / 2);
    return 2 * std::min(1.0, std::sqrt(a * a + std::sin(tilt) * widest * b * b));
  }
};

// The share of the box [−a,a]×[−b,b] where p·x + q·y > −offset: the area of a box cut by a line.
double ShareBeyondLine(double a, double b, double p, double q, double offset) {
  p = std::abs(p) * a;
  q = std::abs(q) * b;
  if (p < q) std::swap(p, q);  // in units of the half widths; p is the greater
  const double s = offset;
  if (s >= p + q) return 1;
  if (s <= -p - q) return 0;
  if (p <= 0) return 0.5;
  if (std::abs(s) <= p - q) return 0.5 + s / (2 * p);  // the line meets two opposite sides
  const double corner = (p + q - std::abs(s)) * (p + q - std::abs(s)) / (8 * p * q);
  return s > 0 ? 1 - corner : corner;
}

// One thread's sums.
struct Sums {
  explicit Sums(size_t sites) : weights(sites, Radiance::Zero()), solid_angles(sites) {}
  std::vector<Radiance> weights;
  std::vector<double> solid_angles;
  Radiance left_out = Radiance::Zero();
  double farthest = 0;
};

class Integrator {
 public:
  Integrator(const EnvironmentMap& map, const Sites& sites, bool upper_only)
      : map_(map), sites_(sites), tree_(3, sites.points), upper_only_(upper_only) {}

  void AddRow(int y, Sums& sums) const {
    double top = map_.TiltOfRow(y).radians(), bottom = map_.TiltOfRow(y + 1).radians();
    const double whole = map_.SolidAngle(y);
    double left_out = 0;
    if (upper_only_ && bottom > kPi / 2) {
      bottom = std::max(top, kPi / 2);
      left_out = whole - 2 * kPi / map_.width() * (std::cos(top) - std::cos(bottom));
      if (top >= kPi / 2) left_out = whole;
    }
    for (int x = 0; x < map_.width(); ++x) {
      const Radiance radiance = map_.At(x, y);
      sums.left_out += left_out * radiance;
      if (bottom <= top) continue;
      const Piece texel{map_.AzimuthOfColumn(x + 0.5).radians(), (top + bottom) / 2,
                        kPi / map_.width(), (bottom - top) / 2};
      AddPiece(texel, radiance, 0, sums);
    }
  }

 private:
  struct Nearest {
    std::array<uint32_t, kNeighbours> site;
    std::array<double, kNeighbours> chord;  // ascending
    size_t found = 0;
  };

  Nearest Find(const Vec3& direction, size_t count) const {
    Nearest near;
    near.found = tree_.knnSearch(direction.data(), count, near.site.data(), near.chord.data());
    for (size_t k = 0; k < near.found; ++k) near.chord[k] = std::sqrt(near.chord[k]);
    return near;
  }

  void Give(uint32_t site, double solid_angle, const Radiance& radiance, Sums& sums) const {
    sums.weights[site] += solid_angle * radiance;
    sums.solid_angles[site] += solid_angle;
  }

  void GiveWhole(const Nearest& near, const Piece& piece, const Radiance& radiance,
                 Sums& sums) const {
    sums.farthest = std::max(sums.farthest, AngleOfChord(near.chord[0]));
    Give(near.site[0], piece.SolidAngle(), radiance, sums);
  }

  void AddPiece(const Piece& piece, const Radiance& radiance, int depth, Sums& sums) const {
    const Vec3 centre = piece.Centre();
    const double radius = piece.Radius();  // a chord, like all distances here
    Nearest near = Find(centre, 2);
    // By the triangle inequality no point of the piece is nearer to another light.
    if (near.found == 1 || near.chord[1] - near.chord[0] > 2 * radius) {
      GiveWhole(near, piece, radiance, sums);
      return;
    }
    near = Find(centre, kNeighbours);
    // A rival takes a part of the piece only if its bisecting plane comes as near to the centre as the piece reaches.
    size_t rivals = 0, rival = 0;
    for (size_t k = 1; k < near.found; ++k) {
      const double apart = (sites_.points.at[near.site[0]] - sites_.points.at[near.site[k]]).norm();
      const double to_plane =
          (near.chord[k] * near.chord[k] - near.chord[0] * near.chord[0]) / (2 * apart);
      if (to_plane > radius) continue;
      ++rivals;
      if (rival == 0) rival = k;
    }
    // Planes of lights farther than the last found one are at least this far away.
    const bool all_known =
        near.found < kNeighbours || near.chord[near.found - 1] - near.chord[0] > 2 * radius;
    if (rivals == 0 && all_known) {
      GiveWhole(near, piece, radiance, sums);
      return;
    }
    const double leaf = rivals == 1 && all_known ? kEdgeLeaf : kVertexLeaf;
    if (radius > std::min(kFlat, leaf * (near.chord[0] + near.chord[1])) && depth < kMaxDepth) {
      const double a = piece.half_azimuth / 2, t = piece.half_tilt / 2;
      for (double da : {-a, a}) {
        for (double dt : {-t, t}) {
          AddPiece({piece.azimuth + da, piece.tilt + dt, a, t}, radiance, depth + 1, sums);
        }
      }
      return;
    }
    if (rival == 0) rival = 1;
    sums.farthest = std::max(sums.farthest, AngleOfChord(near.chord[0]));
    // The bisector as a straight line in the plane that touches the sphere at the centre.
    const Vec3 normal =
        (sites_.points.at[near.site[0]] - sites_.points.at[near.site[rival]]).normalized();
    const double ct = std::cos(piece.tilt), st = std::sin(piece.tilt);
    const double ca = std::cos(piece.azimuth), sa = std::sin(piece.azimuth);
    const double share =
        ShareBeyondLine(piece.half_azimuth * st, piece.half_tilt, normal.dot(Vec3(-sa, ca, 0)),
                        normal.dot(Vec3(ct * ca, ct * sa, -st)), normal.dot(centre));
    const double solid_angle = piece.SolidAngle();
    Give(near.site[0], solid_angle * share, radiance, sums);
    Give(near.site[rival], solid_angle * (1 - share), radiance, sums);
  }

  const EnvironmentMap& map_;
  const Sites& sites_;
  const Tree tree_;
  const bool upper_only_;
};

}  // namespace

absl::StatusOr<Cells> IntegrateOverCells(const EnvironmentMap& map,
                                         const std::vector<Vec3>& directions, Angle rotate) {
  if (directions.empty()) {
    return Error(absl::StatusCode::kInvalidArgument, "NO_LIGHT_DIRECTIONS",
                 "there is no light direction to divide an environment map among");
  }
  Cells cells;
  cells.upper_hemisphere_only = std::none_of(directions.begin(), directions.end(),
                                             [](const Vec3& d) { return d.z() < -kHorizon; });
  const Sites sites = Merge(directions, rotate);
  const Integrator integrator(map, sites, cells.upper_hemisphere_only);
  const int threads = ThreadsFor(map.height());
  std::vector<Sums> sums(threads, Sums(sites.points.at.size()));
  RunOnThreads(threads, [&](int t) {
    for (int y = t; y < map.height(); y += threads) integrator.AddRow(y, sums[t]);
  });
  for (int t = 1; t < threads; ++t) {
    for (size_t i = 0; i < sums[0].weights.size(); ++i) {
      sums[0].weights[i] += sums[t].weights[i];
      sums[0].solid_angles[i] += sums[t].solid_angles[i];
    }
    sums[0].left_out += sums[t].left_out;
    sums[0].farthest = std::max(sums[0].farthest, sums[t].farthest);
  }
  for (const Radiance& w : sums[0].weights) cells.covered += w;
  for (uint32_t site : sites.site_of) {
    cells.weights.push_back(sums[0].weights[site] / sites.members[site]);
    cells.solid_angles.push_back(sums[0].solid_angles[site] / sites.members[site]);
  }
  cells.left_out = sums[0].left_out;
  cells.farthest = Radians(sums[0].farthest);
  return cells;
}

}  // namespace lightstage::relight
