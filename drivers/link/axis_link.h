// Axes behind a link that answers questions: the Axis contract is kept here, once for all of them. A driver brings an AxisLink.
#pragma once

#include <memory>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "drivers/api/axis.h"
#include "drivers/link/device_thread.h"

namespace lightstage {

// What the drive says now.
struct AxisReading {
  Angle position;  // rig frame; of a continuous axis it counts on beyond a turn
  double velocity_dps = 0;
  bool moving = false;
  bool homed = false;
};

// The wire to one drive. Every method runs on the device's thread and may block for as long as the drive may take to answer, which should
// be well below a second. Errors: UNAVAILABLE / DEVICE_LOST if the link is gone and Connect() is needed, DEADLINE_EXCEEDED / DEVICE_SILENT
// if the drive did not answer, FAILED_PRECONDITION / DEVICE_FAULT naming the drive's fault code.
class AxisLink {
 public:
  virtual ~AxisLink() = default;

  // Connects, or connects anew, and leaves the axis at rest. Fails if it is another drive than before.
  virtual absl::Status Connect() = 0;
  // After Connect(); the same after every one. The identity's name and driver are the caller's to fill in.
  virtual AxisInfo info() const = 0;

  virtual absl::StatusOr<AxisReading> Read() = 0;
  // Clears a fault and starts homing; from now on Read() says not homed until it is done, and not moving if it failed.
  virtual absl::Status StartHome() = 0;
  // `target` is one that can be reached from where it stands; of a continuous axis it lies within half a turn. `velocity_dps` > 0.
  virtual absl::Status StartMove(Angle target, double velocity_dps) = 0;
  // Turns at `velocity_dps` (signed, not 0) until Halt(). Asked of continuous axes only. A drive that nobody reaches any more must stop by itself,
  // after `longest` at the latest; UNIMPLEMENTED / CANNOT_TURN if it would not, or can only be positioned. OUT_OF_RANGE if it can not
  // count so far.
  virtual absl::Status StartTurn(double velocity_dps, Duration longest) = 0;
  // Starts to brake.
  virtual absl::Status Halt() = 0;
};

// An Axis over `link`, connected. Asks for the drive's position every `poll` while it moves. FAILED_PRECONDITION / AXIS_OFF_TARGET
// is what Move adds to the contract's errors: the drive says that it stands, but not where it should. After that, or any other failure on the
// way, and if it stands elsewhere than it stood, the axis counts as not homed.
absl::StatusOr<std::unique_ptr<Axis>> OpenLinkedAxis(const DeviceContext& context,
                                                     std::string_view driver,
                                                     std::unique_ptr<AxisLink> link, Duration poll);

}  // namespace lightstage
