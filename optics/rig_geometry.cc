#include "optics/rig_geometry.h"

namespace lightstage {

ViewFrame LookAt(const Vec3& position, const Vec3& target, Angle azimuth_at_pole) {
  ViewFrame frame;
  frame.position = position;
  frame.forward = (target - position).normalized();
  const Vec3& f = frame.forward;
  const double across = std::hypot(f.x(), f.y());
  if (across > 1e-12) {
    frame.down = Vec3(f.z() * f.x(), f.z() * f.y(), -across * across) / across;
  } else {
    frame.down = (f.z() < 0 ? 1 : -1) * DirectionFromAngles(azimuth_at_pole, Degrees(90));
  }
  frame.right = frame.down.cross(frame.forward);
  return frame;
}

ViewFrame CameraFrame(const CameraGeometry& camera) {
  return LookAt(camera.position, camera.look_at);
}

ViewFrame ProjectorFrame(const ProjectorGeometry& projector, const Pose& pose) {
  return LookAt(projector.distance.meters() * ProjectorDirection(projector, pose), Vec3::Zero(),
                projector.azimuth - pose.azimuth);
}

}  // namespace lightstage
