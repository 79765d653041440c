// The drivers named "sim" for all four kinds of device, and the rig file's table [simulation].
#pragma once

#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "drivers/api/registry.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

// The simulation behind one registry: what [simulation] said, and the world while a device or somebody else holds it.
class Simulation {
 public:
  virtual ~Simulation() = default;

  // What [simulation] said; the defaults before a rig file was read. Any thread.
  virtual WorldOptions options() const = 0;

  // That the scene of [simulation] can be built on this rig; OK before a rig file with that table was read. Any thread.
  virtual absl::Status CheckScene(const RigGeometry& geometry) const = 0;

  // The world that this rig's simulated devices share; the first call after the last holder went makes a new one. Any thread.
  virtual absl::StatusOr<std::shared_ptr<World>> OpenWorld(const RigGeometry& geometry,
                                                           Clock& clock) = 0;
};

// Which of the rig's axes the table describes; an error at the table if it is neither. For drivers of simulated axes.
AxisRole AxisRoleOf(const TomlTable& table);

// FAILED_PRECONDITION / GEOMETRY if the rig's brace has not just so many lamps, or none. For drivers of simulated lamps.
absl::Status CheckLampCount(const DeviceContext& context, int lamps);

// FAILED_PRECONDITION / GEOMETRY if the rig has no projector.
absl::Status CheckProjector(const DeviceContext& context);

// Adds the drivers. Whoever serves the simulated picture by other means (sim/peers) gets the world from the result; others may
// ignore it.
std::shared_ptr<Simulation> RegisterSimulatedDrivers(DriverRegistry& registry);

}  // namespace lightstage::sim
