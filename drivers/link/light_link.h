// Lamps and projectors behind a link whose calls block: their contracts are kept here, once for all of them. A driver brings a LampsLink or
// a ProjectorLink.
//
// Every method of a link runs on the device's thread and may block for as long as the device may take to answer, which should be well below
// a second. Errors: UNAVAILABLE / DEVICE_LOST if the link is gone and Connect() is needed, DEADLINE_EXCEEDED / DEVICE_SILENT if the
// device did not answer, FAILED_PRECONDITION / DEVICE_FAULT naming its fault.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "drivers/api/lamps.h"
#include "drivers/api/projector.h"

namespace lightstage {

class LampsLink {
 public:
  virtual ~LampsLink() = default;

  // Connects, or connects anew, and leaves all lamps dark. Fails if it is another device than before. Nothing else is called before it
  // succeeded once. The link's destructor must not need the device.
  virtual absl::Status Connect() = 0;
  // After Connect(); the same after every one. The identity's name and driver are the caller's to fill in.
  virtual LampsInfo info() const = 0;

  // Sets every lamp and says what the device took, as it confirmed it. `levels` are checked.
  virtual absl::StatusOr<std::vector<float>> Set(const std::vector<float>& levels) = 0;
  // As Lamps' own; asked only if the last Connect or Set succeeded.
  virtual absl::Status Check() = 0;
  // As Lamps' own; `time` is checked. What has none: nothing to do.
  virtual absl::Status SetTimeToDark(Duration /*time*/) { return absl::OkStatus(); }
  virtual absl::Status Refresh() { return absl::OkStatus(); }
};

class ProjectorLink {
 public:
  virtual ~ProjectorLink() = default;

  // As a LampsLink's; leaves it black.
  virtual absl::Status Connect() = 0;
  virtual ProjectorInfo info() const = 0;

  // Returns when the device has confirmed that `pattern`, which is valid, is shown.
  virtual absl::Status Show(const Pattern& pattern) = 0;
  // As Projector's own; asked only if the last Connect or Show succeeded.
  virtual absl::Status Check() = 0;
};

// The device over `link`, connected. After DEVICE_LOST, Set, Dark, Show and Black connect anew first. What the contract calls settle passes
// after the link's confirmation. Refresh() does not wait: it says how the one before went.
absl::StatusOr<std::unique_ptr<Lamps>> OpenLinkedLamps(const DeviceContext& context,
                                                       std::string_view driver,
                                                       std::unique_ptr<LampsLink> link);
absl::StatusOr<std::unique_ptr<Projector>> OpenLinkedProjector(const DeviceContext& context,
                                                               std::string_view driver,
                                                               std::unique_ptr<ProjectorLink> link);

}  // namespace lightstage
