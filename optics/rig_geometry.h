// Where a rig's parts are. World frame: origin at the centre of the turntable's top, +Z up, metres. The object frame turns with
// the turntable: it equals the world frame at azimuth 0°. Object and camera ride on the turntable (dissertation p. 46), so the
// camera's pose is given in the object frame and every picture shows the object still.
#pragma once

#include <vector>

#include "base/units.h"
#include "optics/direction.h"

namespace lightstage {

// Where the rig stands. `azimuth`: the turntable's angle, counterclockwise from above. `tilt`: of the projector's gantry from the
// zenith, 0° (above) to 90° (horizon).
struct Pose {
  Angle azimuth;
  Angle tilt;
  bool operator==(const Pose&) const = default;
};

struct LampGeometry {
  Angle azimuth;  // world frame
  Angle tilt;     // from the zenith, [0°, 180°]
};

struct BraceGeometry {
  Length radius;                    // lamps' distance from the origin
  Length lamp_radius;               // of each lamp's emitting disc, which faces the origin
  std::vector<LampGeometry> lamps;  // by lamp index; empty: the rig has no brace
};

struct ProjectorGeometry {
  bool present = false;
  Length distance;            // of its pinhole from the origin, at which it looks
  Angle azimuth;              // world azimuth of the gantry's arm
  Angle field_of_view;        // full horizontal angle
  int width = 0, height = 0;  // native pixels; square pixels
};

struct CameraGeometry {
  Vec3 position = Vec3::Zero();  // object frame, m
  Vec3 look_at = Vec3::Zero();
  Angle field_of_view;  // full horizontal angle
};

struct RigGeometry {
  BraceGeometry brace;
  ProjectorGeometry projector;
  CameraGeometry camera;
};

// Unit vector from the origin to a lamp in the object frame with the turntable at `turntable`.
inline Vec3 LampDirection(const LampGeometry& lamp, Angle turntable) {
  return DirectionFromAngles(lamp.azimuth - turntable, lamp.tilt);
}

// Unit vector from the origin to the projector in the object frame.
inline Vec3 ProjectorDirection(const ProjectorGeometry& projector, const Pose& pose) {
  return DirectionFromAngles(projector.azimuth - pose.azimuth, pose.tilt);
}

// A pinhole device's axes: `right` and `down` span its image as seen from behind it, `forward` is where it looks.
struct ViewFrame {
  Vec3 position, right, down, forward;
};

// A frame at `position` looking at `target` (another point) with the horizon level: `down` is as near −Z as can be. At the poles it
// is the limit of a device that gets there along `azimuth_at_pole`, so that a gantry reaches the zenith without a flip: looking
// straight down, image-down points to that azimuth; looking straight up, away from it.
ViewFrame LookAt(const Vec3& position, const Vec3& target, Angle azimuth_at_pole = Degrees(0));

// The camera's and the projector's frames in the object frame.
ViewFrame CameraFrame(const CameraGeometry& camera);
ViewFrame ProjectorFrame(const ProjectorGeometry& projector, const Pose& pose);

}  // namespace lightstage
