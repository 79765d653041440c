#include "sim/peers/canopen/drivers.h"

#include <utility>

#include "base/status.h"
#include "drivers/canopen/driver.h"
#include "drivers/canopen/options.h"
#include "drivers/canopen/socket_can.h"
#include "drivers/link/device_thread.h"
#include "sim/peers/canopen/drive.h"
#include "sim/peers/canopen/output_module.h"
#include "sim/rig/served.h"

namespace lightstage::sim {
namespace {

constexpr char kName[] = "sim-canopen";

std::string PeerInterface(const TomlTable& table, const canopen::NodeOptions& node) {
  return table.Table("peer").String("interface", node.interface);
}

void Identify(const canopen::NodeOptions& node, PeerIdentity* identity) {
  identity->node = node.node;
  identity->vendor = node.vendor.value_or(identity->vendor);
  identity->product = node.product.value_or(identity->product);
  identity->serial = node.serial.value_or(identity->serial);
}

DeviceOpener<Axis> ParseAxis(const std::shared_ptr<Simulation>& simulation,
                             const TomlTable& table) {
  const canopen::AxisOptions axis = canopen::ParseAxisOptions(table);
  DriveOptions drive;
  Identify(axis.node, &drive.identity);
  drive.role = AxisRoleOf(table);
  drive.units_per_turn = axis.units_per_turn;
  if (axis.velocity_units != std::abs(axis.units_per_turn)) {
    table.ErrorAt("velocity_units_per_turn_s",
                  "must be units_per_turn where the drive is simulated");
  }
  if (axis.acceleration_units != std::abs(axis.units_per_turn)) {
    table.ErrorAt("acceleration_units_per_turn_s2",
                  "must be units_per_turn where the drive is simulated");
  }
  return [simulation, drive, interface = PeerInterface(table, axis.node),
          connect = CanopenAxisDriver().parse(table)](
             const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Axis>> {
    RETURN_IF_ERROR(DeviceThread::CheckClock(context));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    ASSIGN_OR_RETURN(auto port, canopen::OpenSocketCan(interface, *context.clock));
    auto peer = std::make_shared<CanopenDrive>(std::move(port), drive, world);
    ASSIGN_OR_RETURN(std::unique_ptr<Axis> device, connect(context));
    return std::make_unique<ServedAxis>(std::move(peer), std::move(device), kName);
  };
}

DeviceOpener<Lamps> ParseLamps(const std::shared_ptr<Simulation>& simulation,
                               const TomlTable& table) {
  const canopen::LampsOptions lamps = canopen::ParseLampsOptions(table);
  OutputModuleOptions module;
  Identify(lamps.node, &module.identity);
  module.analogue = lamps.output == canopen::LampOutput::kAnalogue;
  module.first_output = lamps.first_output;
  return [simulation, module, interface = PeerInterface(table, lamps.node),
          connect = CanopenLampsDriver().parse(table)](
             const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Lamps>> {
    RETURN_IF_ERROR(DeviceThread::CheckClock(context));
    const auto count = static_cast<int>(context.geometry->brace.lamps.size());
    RETURN_IF_ERROR(CheckLampCount(context, count));
    module.outputs = (module.first_output + count + 7) / 8 * 8;
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    ASSIGN_OR_RETURN(auto port, canopen::OpenSocketCan(interface, *context.clock));
    auto peer = std::make_shared<CanopenOutputModule>(std::move(port), module, world);
    ASSIGN_OR_RETURN(std::unique_ptr<Lamps> device, connect(context));
    return std::make_unique<ServedLamps>(std::move(peer), std::move(device), kName);
  };
}

}  // namespace

void RegisterCanopenPeers(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.axes[kName].parse = [simulation](const TomlTable& table) {
    return ParseAxis(simulation, table);
  };
  registry.lamps[kName].parse = [simulation](const TomlTable& table) {
    return ParseLamps(simulation, table);
  };
}

}  // namespace lightstage::sim
