#include "sim/render/rig_parts.h"

#include <algorithm>
#include <utility>

#include "sim/render/shapes.h"
#include "sim/render/triangles.h"

namespace lightstage::sim {
namespace {

constexpr double kGap = 1e-3;  // between a light or a pinhole and the body behind it

// A box behind a device at `frame.position`.
Mesh BodyBehind(const ViewFrame& frame, double width, double height, double length) {
  Eigen::Affine3f to_frame;
  to_frame.linear() << frame.right.cast<float>(), -frame.down.cast<float>(),
      -frame.forward.cast<float>();
  to_frame.translation() = (frame.position - (kGap + length / 2) * frame.forward).cast<float>();
  return Transformed(
      Box(Vec3f::Zero(), 0.5f * Vec3f(static_cast<float>(width), static_cast<float>(height),
                                      static_cast<float>(length))),
      to_frame);
}

// From `from` to `to`, unless they are in one place.
void AddRod(const Vec3& from, const Vec3& to, double diameter, std::vector<Mesh>* parts) {
  if ((to - from).norm() < 1e-4) return;
  parts->push_back(Rod(from.cast<float>(), to.cast<float>(), static_cast<float>(diameter / 2)));
}

std::vector<Mesh> Brace(const BraceGeometry& brace, double bar) {
  std::vector<Mesh> parts;
  if (bar <= 0) return parts;
  // Behind the lamps there is a housing as wide as the lamp, and the bar behind that.
  const double radius = brace.radius.meters(), housing = 2 * brace.lamp_radius.meters(),
               bar_radius = radius + housing + bar / 2;
  for (size_t i = 0; i < brace.lamps.size(); ++i) {
    const Vec3 direction = LampDirection(brace.lamps[i], Degrees(0));
    AddRod((radius + kGap) * direction, (radius + housing) * direction,
           2 * brace.lamp_radius.meters(), &parts);
    if (i == 0) continue;
    const Vec3 before = LampDirection(brace.lamps[i - 1], Degrees(0));
    // Lamps one by one, anywhere, have no bar in common.
    constexpr double kNeighbours = 0.7;  // cosine
    if (direction.dot(before) > kNeighbours)
      AddRod(bar_radius * before, bar_radius * direction, bar, &parts);
  }
  return parts;
}

}  // namespace

std::vector<Mesh> CameraBody(const CameraGeometry& camera, const PartOptions& options) {
  const double width = options.camera_body;
  if (width <= 0) return {};
  Mesh body = BodyBehind(CameraFrame(camera), width, width, 2 * width);
  body.name = "the camera's body";
  return {std::move(body)};
}

RigParts::RigParts(const RigGeometry& geometry, const PartOptions& options)
    : geometry_(geometry),
      options_(geometry.projector.present ? options
                                          : PartOptions{.camera_body = options.camera_body,
                                                        .brace_bar = options.brace_bar}),
      brace_(Brace(geometry.brace, options.brace_bar)),
      device_(rtcNewDevice("threads=1")) {}

RigParts::~RigParts() { rtcReleaseDevice(device_); }

std::unique_ptr<RTCSceneTy, RigParts::Release> RigParts::At(const Pose& pose) const {
  if (empty()) return nullptr;
  std::vector<Mesh> parts;
  // The brace stands still while the object turns.
  const Eigen::Affine3f to_object(
      Eigen::AngleAxisf(static_cast<float>(-pose.azimuth.radians()), Vec3f::UnitZ()));
  for (const Mesh& mesh : brace_) parts.push_back(Transformed(mesh, to_object));
  const double bar = options_.gantry_bar, width = options_.projector_body;
  const ViewFrame frame = gantry() ? ProjectorFrame(geometry_.projector, pose) : ViewFrame{};
  if (width > 0) parts.push_back(BodyBehind(frame, width, width / 2, width));
  if (bar > 0) {
    // The gantry turns about a horizontal axis through the origin; its bars go up on both sides, farther out than the camera ever comes.
    const double side = geometry_.camera.position.norm() + width + 2 * bar;
    for (const double sign : {-1.0, 1.0}) {
      const Vec3 axis = sign * side * frame.right, top = axis + frame.position;
      AddRod(axis, top, bar, &parts);
      AddRod(top, frame.position - (kGap + bar) * frame.forward + sign * width / 2 * frame.right,
             bar, &parts);
    }
  }
  std::unique_ptr<RTCSceneTy, Release> scene(rtcNewScene(device_));
  for (const Mesh& mesh : parts) {
    RTCGeometry geometry = MakeTriangles(device_, mesh);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene.get(), geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene.get());
  return scene;
}

}  // namespace lightstage::sim
