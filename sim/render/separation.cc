#include "sim/render/separation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/status.h"

namespace lightstage::sim {

using Eigen::Vector3d;

// Ericson, "Real-Time Collision Detection", 2005, section 5.1.5: by the region of the plane over which the point is.
double SquaredDistance(const Vector3d& point, const Triangle& triangle) {
  const auto& [a, b, c] = triangle;
  const Vector3d ab = b - a, ac = c - a, ap = point - a, bp = point - b, cp = point - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp),
               d6 = ac.dot(cp);
  if (d1 <= 0 && d2 <= 0) return ap.squaredNorm();
  if (d3 >= 0 && d4 <= d3) return bp.squaredNorm();
  if (d6 >= 0 && d5 <= d6) return cp.squaredNorm();
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return (ap - d1 / (d1 - d3) * ab).squaredNorm();
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return (ap - d2 / (d2 - d6) * ac).squaredNorm();
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    return (bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)).squaredNorm();
  }
  const double sum = va + vb + vc;
  return (ap - vb / sum * ab - vc / sum * ac).squaredNorm();
}

bool Crosses(const Vector3d& from, const Vector3d& to, const Triangle& triangle, double rounding) {
  const auto& [a, b, c] = triangle;
  const Vector3d normal = (b - a).cross(c - a).normalized();
  const double above = normal.dot(from - a), below = normal.dot(to - a);
  if (std::min(above, below) >= -rounding || std::max(above, below) <= rounding) return false;
  const Vector3d at = from + above / (above - below) * (to - from);
  for (int k = 0; k < 3; ++k) {
    const Vector3d &p = triangle[k], &q = triangle[(k + 1) % 3];
    if (normal.dot((q - p).cross(at - p)) < 0) return false;
  }
  return true;
}

namespace {

// Of two segments from p along u and from q along v; Ericson, section 5.1.9.
double SquaredDistance(const Vector3d& p, const Vector3d& u, const Vector3d& q, const Vector3d& v) {
  const Vector3d r = p - q;
  const double a = u.squaredNorm(), e = v.squaredNorm(), f = v.dot(r), c = u.dot(r), b = u.dot(v);
  const double denominator = a * e - b * b;  // 0 if they are parallel
  double s = denominator > 0 ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0.0;
  const double t = std::clamp((b * s + f) / e, 0.0, 1.0);
  s = std::clamp((b * t - c) / a, 0.0, 1.0);
  return (r + s * u - t * v).squaredNorm();
}

}  // namespace

// They are nearest at a corner of one of them or at an edge of both, if they do not cross.
bool AreNear(const Triangle& a, const Triangle& b, double gap) {
  const double most = gap * gap;
  for (const auto& [from, to] : {std::pair(&a, &b), std::pair(&b, &a)}) {
    for (int k = 0; k < 3; ++k) {
      if (SquaredDistance((*from)[k], *to) <= most) return true;
      if (Crosses((*from)[k], (*from)[(k + 1) % 3], *to, 0)) return true;
    }
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const Vector3d u = a[(i + 1) % 3] - a[i], v = b[(j + 1) % 3] - b[j];
      if (SquaredDistance(a[i], u, b[j], v) <= most) return true;
    }
  }
  return false;
}

double TurnedBox::From(const Vector3d& direction) const {
  return direction.dot(center) - (axes.transpose() * direction).cwiseAbs().dot(half);
}

double TurnedBox::To(const Vector3d& direction) const {
  return direction.dot(center) + (axes.transpose() * direction).cwiseAbs().dot(half);
}

TurnedBox BoxAround(const std::vector<Eigen::Vector3f>& points) {
  Vector3d mean = Vector3d::Zero();
  for (const auto& p : points) mean += p.cast<double>() / static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& p : points) {
    const Vector3d off = p.cast<double>() - mean;
    covariance += off * off.transpose();
  }
  TurnedBox out;
  out.axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvectors();
  Eigen::AlignedBox3d box;
  for (const auto& p : points) box.extend(out.axes.transpose() * p.cast<double>());
  out.center = out.axes * box.center();
  out.half = box.sizes() / 2;
  return out;
}

TurnedBox Transformed(const TurnedBox& box, const Eigen::Affine3d& transform) {
  const double scale = std::cbrt(transform.linear().determinant());
  return {transform * box.center, transform.linear() / scale * box.axes, scale * box.half};
}

bool AreApart(const TurnedBox& a, const TurnedBox& b, double gap) {
  // In a's frame. Of parallel axes the cross product is nothing but rounding, which must not separate.
  constexpr double kRounding = 1e-9;
  const Eigen::Matrix3d turn = a.axes.transpose() * b.axes;
  const Eigen::Matrix3d size = turn.cwiseAbs().array() + kRounding;
  const Vector3d way = a.axes.transpose() * (b.center - a.center);
  const Vector3d p = a.half.array() + gap / 2, q = b.half.array() + gap / 2;
  if ((way.cwiseAbs().array() > (p + size * q).array()).any()) return true;
  if (((turn.transpose() * way).cwiseAbs().array() > (q + size.transpose() * p).array()).any())
    return true;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; ++j) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      const double reach =
          p[i1] * size(i2, j) + p[i2] * size(i1, j) + q[j1] * size(i, j2) + q[j2] * size(i, j1);
      if (std::abs(way[i2] * turn(i1, j) - way[i1] * turn(i2, j)) > reach) return true;
    }
  }
  return false;
}

namespace {

// One along which the boxes are short against all of them together, so that few are abreast of each other: an axis, or one of a box.
Vector3d SweepDirection(const std::vector<TurnedBox>& boxes) {
  Eigen::Matrix<double, 3, 6> directions;
  directions << Eigen::Matrix3d::Identity(), boxes.front().axes;
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int d = 0; d < directions.cols(); ++d) {
    double sum = 0, from = boxes.front().From(directions.col(d)), to = from;
    for (const TurnedBox& box : boxes) {
      const double begin = box.From(directions.col(d)), end = box.To(directions.col(d));
      sum += end - begin;
      from = std::min(from, begin);
      to = std::max(to, end);
    }
    if (sum / (to - from) < least) least = sum / (to - from), best = d;
  }
  return directions.col(best);
}

}  // namespace

absl::Status CheckPairs(const std::vector<TurnedBox>& boxes, double gap,
                        absl::FunctionRef<absl::Status(size_t, size_t)> check) {
  if (boxes.empty()) return absl::OkStatus();
  const Vector3d direction = SweepDirection(boxes);
  std::vector<std::pair<double, size_t>> begins;
  for (size_t i = 0; i < boxes.size(); ++i) begins.emplace_back(boxes[i].From(direction), i);
  std::sort(begins.begin(), begins.end());
  for (size_t i = 0; i < begins.size(); ++i) {
    const double end = boxes[begins[i].second].To(direction) + gap;
    for (size_t j = i + 1; j < begins.size() && begins[j].first <= end; ++j)
      RETURN_IF_ERROR(check(begins[i].second, begins[j].second));
  }
  return absl::OkStatus();
}

}  // namespace lightstage::sim
