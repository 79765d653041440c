#include "sim/render/check_filled.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "sim/render/check_scene.h"
#include "sim/render/separation.h"
#include "sim/render/winding.h"

namespace lightstage::sim {
namespace {

using Eigen::Vector3d;

// Between boundaries, metres: a path that has passed one goes on 1e-6 m behind it (paths.cc), and must not be behind the next one there.
constexpr double kLeastGap = 1e-5;

struct ReleaseScene {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};

// A shape of glass or of a medium, in its place.
class Solid {
 public:
  Solid(const Mesh& mesh, const Shells& shells, std::string name, bool medium, TurnedBox box,
        const Eigen::Affine3f* placement)
      : mesh_(&mesh),
        shells_(&shells),
        placement_(placement),
        name_(std::move(name)),
        medium_(medium),
        box_(std::move(box)) {}
  Solid(const Ball& ball, std::string name, bool medium)
      : ball_(&ball),
        name_(std::move(name)),
        medium_(medium),
        box_{ball.center.cast<double>(), Eigen::Matrix3d::Identity(),
             Vector3d::Constant(ball.radius)} {}

  const std::string& name() const { return name_; }
  bool medium() const { return medium_; }
  const TurnedBox& box() const { return box_; }
  const Mesh& mesh() const { return *mesh_; }
  const Shells& shells() const { return *shells_; }

  Triangle TriangleAt(uint32_t index) const {
    Triangle out;
    for (int k = 0; k < 3; ++k) out[k] = Place(mesh_->vertices[mesh_->triangles[index][k]]);
    return out;
  }

  // Whether a triangle, or the ball, and one of another solid are not farther apart than the least gap.
  bool IsNear(uint32_t index, const Solid& other, uint32_t other_index) const {
    if (ball_ == nullptr && other.ball_ == nullptr)
      return AreNear(TriangleAt(index), other.TriangleAt(other_index), kLeastGap);
    if (ball_ == nullptr) return other.IsNear(other_index, *this, index);
    const Vector3d center = ball_->center.cast<double>();
    const double reach = double{ball_->radius} + kLeastGap;
    if (other.ball_ != nullptr)
      return (center - other.ball_->center.cast<double>()).norm() <= reach + other.ball_->radius;
    return SquaredDistance(center, other.TriangleAt(other_index)) <= reach * reach;
  }

  // Whether one that does not come near has a part in this one.
  bool Contains(const Solid& other) const {
    if (other.ball_ != nullptr) return Encloses(other.ball_->center.cast<double>());
    const auto& shells = other.shells_->all();
    return std::any_of(shells.begin(), shells.end(), [&](const Shells::Shell& shell) {
      return Encloses(other.TriangleAt(shell.triangles[0])[0]);
    });
  }

  // Its triangles as boxes, for rtcCollide; made when they are first asked for, and then no longer in need of this.
  RTCScene Boxes(RTCDevice device) const {
    if (boxes_ != nullptr) return boxes_.get();
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(
        geometry, ball_ != nullptr ? 1 : static_cast<unsigned>(mesh_->triangles.size()));
    rtcSetGeometryUserData(geometry, const_cast<Solid*>(this));  // only read
    rtcSetGeometryBoundsFunction(geometry, &Bounds, nullptr);
    rtcCommitGeometry(geometry);
    boxes_.reset(rtcNewScene(device));
    rtcAttachGeometry(boxes_.get(), geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(boxes_.get());
    // Of what is sound, for nothing else.
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) throw std::bad_alloc();
    return boxes_.get();
  }

 private:
  // As the renderer places it (scene.cc).
  Vector3d Place(const Vec3f& vertex) const {
    return (placement_ != nullptr ? Vec3f(*placement_ * vertex) : vertex).cast<double>();
  }

  bool Encloses(const Vector3d& point) const {
    if (ball_ != nullptr) return (point - ball_->center.cast<double>()).norm() < ball_->radius;
    const Vector3d own =
        placement_ != nullptr ? Vector3d(placement_->cast<double>().inverse() * point) : point;
    return shells_->WindingNumber(own) != 0;
  }

  static void Bounds(const RTCBoundsFunctionArguments* args) {
    const auto& solid = *static_cast<const Solid*>(args->geometryUserPtr);
    Eigen::AlignedBox3d box;
    if (solid.ball_ != nullptr) {
      box = Eigen::AlignedBox3d(solid.box_.center - solid.box_.half,
                                solid.box_.center + solid.box_.half);
    } else {
      for (const Vector3d& corner : solid.TriangleAt(args->primID)) box.extend(corner);
    }
    const Eigen::Vector3f low = (box.min().array() - kLeastGap).matrix().cast<float>(),
                          high = (box.max().array() + kLeastGap).matrix().cast<float>();
    RTCBounds& out = *args->bounds_o;
    out.lower_x = low.x(), out.lower_y = low.y(), out.lower_z = low.z();
    out.upper_x = high.x(), out.upper_y = high.y(), out.upper_z = high.z();
  }

  const Ball* ball_ = nullptr;  // or a mesh:
  const Mesh* mesh_ = nullptr;
  const Shells* shells_ = nullptr;
  const Eigen::Affine3f* placement_ = nullptr;  // null: as it is
  std::string name_;
  bool medium_;
  TurnedBox box_;
  mutable std::unique_ptr<RTCSceneTy, ReleaseScene> boxes_;
};

// The first pair of triangles (of a ball: 0) whose boxes meet and of which `is_wrong` is true. It may be called from several threads.
using Pair = std::pair<uint32_t, uint32_t>;
template <class F>
std::optional<Pair> Collide(const Solid& a, const Solid& b, RTCDevice device, F is_wrong) {
  struct Search {
    F is_wrong;
    std::atomic<bool> found = false;
    Pair pair = {};
  } search{std::move(is_wrong)};
  rtcCollide(
      a.Boxes(device), b.Boxes(device),
      [](void* to, RTCCollision* collisions, unsigned int count) {
        auto& search = *static_cast<Search*>(to);
        for (unsigned int i = 0; i < count && !search.found; ++i) {
          const Pair pair(collisions[i].primID0, collisions[i].primID1);
          if (search.is_wrong(pair.first, pair.second) && !search.found.exchange(true))
            search.pair = pair;
        }
      },
      &search);
  if (!search.found) return {};
  return search.pair;
}

// Whether an edge of one goes through the other. Those from a corner that both have do not.
bool CrossEachOther(const Solid& solid, uint32_t i, uint32_t j) {
  constexpr double kRounding = 1e-6;  // of the vertices' coordinates
  const auto& places = solid.shells().places();
  for (const auto& [edges, through] : {std::pair(i, j), std::pair(j, i)}) {
    const Triangle from = solid.TriangleAt(edges), to = solid.TriangleAt(through);
    const auto &corners = solid.mesh().triangles[edges], &others = solid.mesh().triangles[through];
    auto is_shared = [&](int k) {
      return std::any_of(others.begin(), others.end(),
                         [&](uint32_t other) { return places[other] == places[corners[k]]; });
    };
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      if (is_shared(k) || is_shared(next)) continue;
      const double rounding = kRounding * to[0].cwiseAbs().maxCoeff();
      if (Crosses(from[k], from[next], to, rounding)) return true;
    }
  }
  return false;
}

absl::Status Wrong(const Solid& solid, const std::string& what) {
  return Error(absl::StatusCode::kInvalidArgument, "SCENE", absl::StrCat(solid.name(), ": ", what),
               {{"shape", solid.name()}});
}

// That it goes once around what is inside of it. Found are shells (Shells) that come near each other, triangles of one that cross, and
// shells under whose first triangle the winding number is not 1: those within another one that faces the same way, those that are there
// twice, those that are inside out on their own.
absl::Status CheckOnce(const Solid& solid, RTCDevice device) {
  const Shells& shells = solid.shells();
  const auto crossing = Collide(solid, solid, device, [&](uint32_t i, uint32_t j) {
    if (i == j) return false;
    return shells.Of(i) == shells.Of(j) ? CrossEachOther(solid, i, j) : solid.IsNear(i, solid, j);
  });
  if (crossing.has_value()) {
    return Wrong(solid,
                 absl::StrFormat("it crosses or touches itself, which glass and media must not: "
                                 "triangles %d and %d",
                                 crossing->first, crossing->second));
  }
  for (const Shells::Shell& shell : shells.all()) {
    const auto& [a, b, c] = solid.TriangleAt(shell.triangles[0]);
    const Vector3d area = (b - a).cross(c - a);
    // A millionth of its size under it.
    const Vector3d under = (a + b + c) / 3 - 1e-6 / std::sqrt(area.norm()) * area;
    const int times = shells.WindingNumber(under);
    if (times == 1) continue;
    return Wrong(solid, absl::StrFormat("it goes %d times round the place under triangle %d, which "
                                        "must be once for glass and media",
                                        times, shell.triangles[0]));
  }
  return absl::OkStatus();
}

absl::Status CheckPair(const Solid& a, const Solid& b, RTCDevice device) {
  if (!a.medium() && !b.medium()) return absl::OkStatus();
  if (AreApart(a.box(), b.box(), kLeastGap)) return absl::OkStatus();
  const bool near =
      Collide(a, b, device, [&](uint32_t i, uint32_t j) { return a.IsNear(i, b, j); }).has_value();
  if (!near && !a.Contains(b) && !b.Contains(a)) return absl::OkStatus();
  return Error(
      absl::StatusCode::kInvalidArgument, "SCENE",
      absl::StrFormat("%s and %s overlap or touch: a medium may not overlap another one or "
                      "glass; leave a gap of %g mm or more",
                      a.name(), b.name(), 1e3 * kLeastGap),
      {{"shape", a.name()}, {"other", b.name()}});
}

}  // namespace

absl::Status CheckFilled(const SceneDescription& description, RTCDevice device) {
  std::vector<Solid> solids;
  std::map<const Mesh*, Shells> shells;  // the solids point into it
  for (size_t i = 0; i < description.meshes.size(); ++i) {
    const Mesh& mesh = description.meshes[i];
    const Material& material = description.materials[mesh.material];
    if (!material.has_inside()) continue;
    const bool medium = material.kind == Material::Kind::kMedium;
    const Shells& own = shells.try_emplace(&mesh, mesh).first->second;
    const TurnedBox box = BoxAround(mesh.vertices);
    Solid once(mesh, own, NameOf(mesh, i), medium, box, nullptr);
    RETURN_IF_ERROR(CheckOnce(once, device));
    if (mesh.placements.empty()) solids.push_back(std::move(once));
    for (const Eigen::Affine3f& placement : mesh.placements) {
      solids.emplace_back(mesh, own, NameOf(mesh, i), medium,
                          Transformed(box, placement.cast<double>()), &placement);
    }
  }
  for (size_t i = 0; i < description.balls.size(); ++i) {
    const Ball& ball = description.balls[i];
    const Material& material = description.materials[ball.material];
    if (!material.has_inside()) continue;
    solids.emplace_back(ball, absl::StrCat("ball ", i), material.kind == Material::Kind::kMedium);
  }
  std::vector<TurnedBox> boxes;
  for (const Solid& solid : solids) boxes.push_back(solid.box());
  return CheckPairs(boxes, kLeastGap,
                    [&](size_t i, size_t j) { return CheckPair(solids[i], solids[j], device); });
}

}  // namespace lightstage::sim
