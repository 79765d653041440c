// Whether shapes come near each other, in double precision.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"

namespace lightstage::sim {

using Triangle = std::array<Eigen::Vector3d, 3>;

double SquaredDistance(const Eigen::Vector3d& point, const Triangle& triangle);

// Whether a segment passes from one side of a triangle, by more than `rounding`, through it to the other.
bool Crosses(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const Triangle& triangle,
             double rounding);

// Whether two triangles have points not farther from each other than `gap`.
bool AreNear(const Triangle& a, const Triangle& b, double gap);

// A box that is turned as what it holds.
struct TurnedBox {
  Eigen::Vector3d center;
  Eigen::Matrix3d axes;  // unit columns
  Eigen::Vector3d half;

  // From and to where it reaches in a unit direction.
  double From(const Eigen::Vector3d& direction) const;
  double To(const Eigen::Vector3d& direction) const;
};

// Along the points' principal axes.
TurnedBox BoxAround(const std::vector<Eigen::Vector3f>& points);

// Turned, moved and scaled (a similarity).
TurnedBox Transformed(const TurnedBox& box, const Eigen::Affine3d& transform);

// Whether a plane with more than `gap` between them separates them (Gottschalk, Lin, Manocha, "OBBTree", 1996).
bool AreApart(const TurnedBox& a, const TurnedBox& b, double gap);

// Calls `check` for the pairs of boxes that are not farther than `gap` from each other in one direction, in which few of them are, until
// it says no. All that are not farther than that from each other are among them.
absl::Status CheckPairs(const std::vector<TurnedBox>& boxes, double gap,
                        absl::FunctionRef<absl::Status(size_t, size_t)> check);

}  // namespace lightstage::sim
