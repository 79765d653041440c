#include "sim/peers/canopen/drivers.h"

#include <cmath>
#include <utility>

#include "base/status.h"
#include "drivers/canopen/memory_bus.h"
#include "drivers/canopen/open.h"
#include "drivers/canopen/options.h"
#include "drivers/canopen/socket_can.h"
#include "drivers/link/device_thread.h"
#include "sim/peers/canopen/drive.h"
#include "sim/peers/canopen/output_module.h"
#include "sim/rig/fault_plan.h"
#include "sim/rig/served.h"
#include "sim/rig/wire.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr char kName[] = "sim-canopen";

struct WireOptions {
  bool kernel = true;
  std::string interface, peer_interface;
};

WireOptions ParseWire(const TomlTable& peer, const canopen::NodeOptions& node) {
  return {ParseWireIsKernel(peer), node.interface, peer.String("interface", node.interface)};
}

// The two ends of a wire.
struct Wire {
  std::shared_ptr<canopen::MemoryBus> memory;  // shared with the bus; none if it is the kernel's
  std::unique_ptr<canopen::CanPort> peer;
  std::shared_ptr<canopen::CanBus> bus;  // shared by the driver's devices on it
};

absl::StatusOr<Wire> OpenWire(const DeviceContext& context, const WireOptions& options) {
  RETURN_IF_ERROR(DeviceThread::CheckClock(context));
  Clock& clock = *context.clock;
  Wire wire;
  if (options.kernel) {
    ASSIGN_OR_RETURN(wire.peer, canopen::OpenSocketCan(options.peer_interface, clock));
    wire.bus = canopen::CanBus::Shared(
        options.interface, clock,
        [name = options.interface, &clock] { return canopen::OpenSocketCan(name, clock); });
    return wire;
  }
  wire.memory = std::make_shared<canopen::MemoryBus>(clock);
  wire.peer = wire.memory->Attach();
  wire.bus = std::make_shared<canopen::CanBus>(
      context.name, clock,
      [memory = wire.memory]() -> absl::StatusOr<std::unique_ptr<canopen::CanPort>> {
        return memory->Attach();
      });
  return wire;
}

void Identify(const canopen::NodeOptions& node, PeerIdentity* identity) {
  identity->node = node.node;
  identity->vendor = node.vendor.value_or(identity->vendor);
  identity->product = node.product.value_or(identity->product);
  identity->serial = node.serial.value_or(identity->serial);
}

// What every node may do. What is at fault outlives the plan.
std::vector<FaultKind> NodeFaults(PeerNode& node, canopen::MemoryBus* memory, Duration heartbeat) {
  std::vector<FaultKind> kinds = {
      {"silent", heartbeat * 2, [&node](bool on) { node.SetSilent(on); }},
      {"answers 20 ms late", milliseconds(500),
       [&node](bool on) { node.DelayAnswers(milliseconds(on ? 20 : 0)); }},
      Once("power cycle", [&node] { node.Reboot(); })};
  if (memory == nullptr) return kinds;
  kinds.push_back({"bus-off", milliseconds(300), [memory](bool on) {
                     memory->SetState(on ? canopen::CanState::kBusOff : canopen::CanState::kActive);
                   }});
  return kinds;
}

// A peer with what it needs; the plan goes first.
template <class Peer>
struct Served {
  std::shared_ptr<canopen::MemoryBus> memory;
  std::unique_ptr<Peer> peer;
  std::unique_ptr<FaultPlan> faults;
};

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
  const TomlTable peer = table.Table("peer");
  return [simulation, axis, drive, wires = ParseWire(peer, axis.node), plan = ParseFaultPlan(peer)](
             const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Axis>> {
    ASSIGN_OR_RETURN(Wire wire, OpenWire(context, wires));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    auto served = std::make_shared<Served<CanopenDrive>>();
    served->memory = wire.memory;
    served->peer = std::make_unique<CanopenDrive>(std::move(wire.peer), drive, world);
    ASSIGN_OR_RETURN(std::unique_ptr<Axis> device,
                     canopen::OpenAxis(context, kName, axis, std::move(wire.bus)));
    CanopenDrive& turns = *served->peer;
    std::vector<FaultKind> kinds =
        NodeFaults(turns.node(), served->memory.get(), axis.node.heartbeat);
    kinds.push_back(Once("drive fault 7500h", [&turns] { turns.Fail(0x7500); }));
    kinds.push_back(Once("a set-point lost", [&turns] { turns.LoseSetpoints(1); }));
    kinds.push_back(Once("two set-points lost", [&turns] { turns.LoseSetpoints(2); }));
    kinds.push_back(Once("power cut at the enable input", [&turns] { turns.CutPower(); }));
    kinds.push_back(
        {"following error", milliseconds(500), [&turns](bool on) { turns.SetFollowingError(on); }});
    served->faults = std::make_unique<FaultPlan>(context.name, plan, std::move(kinds));
    return std::make_unique<ServedAxis>(std::move(served), std::move(device), kName);
  };
}

DeviceOpener<Lamps> ParseLamps(const std::shared_ptr<Simulation>& simulation,
                               const TomlTable& table) {
  const canopen::LampsOptions lamps = canopen::ParseLampsOptions(table);
  OutputModuleOptions module;
  Identify(lamps.node, &module.identity);
  module.analogue = lamps.output == canopen::LampOutput::kAnalogue;
  module.first_output = lamps.first_output;
  const TomlTable peer = table.Table("peer");
  return
      [simulation, lamps, module, wires = ParseWire(peer, lamps.node), plan = ParseFaultPlan(peer)](
          const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Lamps>> {
        ASSIGN_OR_RETURN(Wire wire, OpenWire(context, wires));
        const auto count = static_cast<int>(context.geometry->brace.lamps.size());
        RETURN_IF_ERROR(CheckLampCount(context, count));
        module.outputs = (module.first_output + count + 7) / 8 * 8;
        ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                         simulation->OpenWorld(*context.geometry, *context.clock));
        auto served = std::make_shared<Served<CanopenOutputModule>>();
        served->memory = wire.memory;
        served->peer = std::make_unique<CanopenOutputModule>(std::move(wire.peer), module, world);
        ASSIGN_OR_RETURN(std::unique_ptr<Lamps> device,
                         canopen::OpenLamps(context, kName, lamps, std::move(wire.bus)));
        CanopenOutputModule& outputs = *served->peer;
        std::vector<FaultKind> kinds =
            NodeFaults(outputs.node(), served->memory.get(), lamps.node.heartbeat);
        kinds.push_back({"writes are confirmed and not done", milliseconds(500),
                         [&outputs](bool on) { outputs.IgnoreWrites(on); }});
        kinds.push_back({"emergency 2310h", milliseconds(500), [&outputs](bool begins) {
                           outputs.node().Do([&](ObjectDictionary&) {
                             outputs.node().Emergency(begins ? 0x2310 : 0, begins ? 3 : 0);
                           });
                         }});
        served->faults = std::make_unique<FaultPlan>(context.name, plan, std::move(kinds));
        return std::make_unique<ServedLamps>(std::move(served), std::move(device), kName);
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
