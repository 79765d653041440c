// A projector that shows one pattern at a time.
#pragma once

#include <variant>

#include "drivers/api/device.h"
#include "optics/pattern.h"

namespace lightstage {

struct ProjectorInfo {
  DeviceIdentity identity;
  int width = 0, height = 0;  // native pixels
  Duration settle{};          // from the command until the light is right; part of every Show
};

struct ProjectorState {
  Pattern shown;  // as the device confirmed it
};

class Projector {
 public:
  virtual ~Projector() = default;

  virtual const ProjectorInfo& info() const = 0;

  // Shows `pattern` (valid, optics/pattern.h) and completes when the device has confirmed that its light is on the wall.
  virtual void Show(const Pattern& pattern, TimePoint deadline,
                    Completion<ProjectorState> done) = 0;

  // Any thread. As dark as it can be; a Show in progress completes with CANCELLED first.
  virtual void Black(TimePoint deadline, Completion<ProjectorState> done) = 0;

  // As Lamps::Check(), since the last Show or Black.
  virtual void Check(TimePoint deadline, Completion<std::monostate> done);
};

}  // namespace lightstage
