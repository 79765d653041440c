// One rotary axis: the turntable or the projector's gantry. Angles are degrees in the rig's frame; the driver converts.
#pragma once

#include "drivers/api/device.h"

namespace lightstage {

struct AxisInfo {
  DeviceIdentity identity;
  // Reachable positions. A continuous axis turns without end: it takes any target and goes the short way.
  Angle min, max;
  bool continuous = false;
  double max_velocity_dps = 0;       // °/s, > 0
  double max_acceleration_dps2 = 0;  // °/s², > 0
  Duration settle{};                 // from standstill until vibration has gone; part of every Move
  Angle tolerance;                   // |reported − commanded| after a good move
};

struct AxisState {
  Angle position;
  double velocity_dps = 0;
  bool homed = false;
  bool moving = false;  // includes settling
};

class Axis {
 public:
  virtual ~Axis() = default;

  virtual const AxisInfo& info() const = 0;

  // Finds the reference position; needed once after power-on or after a lost position.
  virtual void Home(TimePoint deadline, Completion<AxisState> done) = 0;

  // Goes to `target`, at most `velocity_dps` fast (0: the axis' maximum), and completes once it has settled within tolerance.
  // FAILED_PRECONDITION / NOT_HOMED; OUT_OF_RANGE / AXIS_LIMIT before any motion; CANCELLED by Stop. One motion at a time: a second
  // one is FAILED_PRECONDITION / AXIS_BUSY.
  virtual void Move(Angle target, double velocity_dps, TimePoint deadline,
                    Completion<AxisState> done) = 0;

  // Turns at `velocity_dps` (signed; see CheckTurn) until Stop, or the deadline at the latest. NOT_HOMED and AXIS_BUSY as Move;
  // FAILED_PRECONDITION / AXIS_STALLED if it stands though nobody stopped it; UNIMPLEMENTED / CANNOT_TURN, before any motion, of a drive
  // that can only be positioned.
  virtual void Turn(double velocity_dps, TimePoint deadline, Completion<AxisState> done) = 0;

  // What the device says now.
  virtual void Read(TimePoint deadline, Completion<AxisState> done) = 0;

  // Any thread. Decelerates to standstill; the motion in progress completes with CANCELLED / STOPPED first.
  virtual void Stop(TimePoint deadline, Completion<AxisState> done) = 0;
};

// How long a Move over `distance` takes with a trapezoidal velocity profile, settling included. For plans and deadlines.
Duration MoveDuration(const AxisInfo& info, Angle from, Angle to, double velocity_dps = 0);

// The signed way a move takes: the short one on a continuous axis.
Angle MoveDistance(const AxisInfo& info, Angle from, Angle to);

// OUT_OF_RANGE / AXIS_LIMIT naming axis, value and limits; NaN and infinity are out of range.
absl::Status CheckTarget(const AxisInfo& info, Angle target);

// OUT_OF_RANGE / AXIS_VELOCITY unless 0 < |velocity_dps| <= the axis' maximum.
absl::Status CheckVelocity(const AxisInfo& info, double velocity_dps);

// For Turn: CheckVelocity, and FAILED_PRECONDITION / AXIS_LIMITED unless the axis is continuous.
absl::Status CheckTurn(const AxisInfo& info, double velocity_dps);

}  // namespace lightstage
