#include "sim/peers/modbus/drivers.h"

#include <spdlog/spdlog.h>

#include <optional>
#include <utility>

#include "base/status.h"
#include "drivers/link/device_thread.h"
#include "drivers/modbus/axis.h"
#include "drivers/modbus/lamps.h"
#include "drivers/modbus/options.h"
#include "sim/peers/modbus/drive_peer.h"
#include "sim/peers/modbus/lamps_peer.h"
#include "sim/peers/modbus/server.h"
#include "sim/rig/fault_plan.h"
#include "sim/rig/served.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr char kName[] = "sim-modbus";

void CheckLine(const TomlTable& table, const LineOptions& line) {
  if (line.serial_port.empty() && line.host != "127.0.0.1") {
    table.ErrorAt("host", absl::StrCat("is \"", line.host,
                                       "\", must be \"127.0.0.1\": this process serves it itself"));
  }
}

absl::StatusOr<std::unique_ptr<ModbusServer>> Serve(const LineOptions& line,
                                                    ModbusServer::Devices devices) {
  return line.serial_port.empty() ? ModbusServer::StartTcp(std::move(devices), line.port)
                                  : ModbusServer::StartRtu(std::move(devices), line.serial_port);
}

// What a server and its devices need to go wrong at random.
struct Served {
  std::unique_ptr<ModbusServer> server;
  std::unique_ptr<FaultPlan> faults;  // first to go
};

// A fault of the wire that ends by itself, after so many requests.
FaultKind OfWire(ModbusServer& server, const char* name, WireFault fault, int requests,
                 int parameter = 0) {
  return Once(absl::StrCat(name, ", ", requests, " times"),
              [&server, fault, requests, parameter] { server.Inject(fault, requests, parameter); });
}

// More requests than the driver asks anew stop it; fewer must not.
std::vector<FaultKind> WireFaults(ModbusServer& server) {
  return {OfWire(server, "no answer", WireFault::kSilence, 1),
          OfWire(server, "no answer", WireFault::kSilence, 10),
          OfWire(server, "done and not answered", WireFault::kLostReply, 1),
          OfWire(server, "wrong CRC or transaction", WireFault::kGarbage, 1),
          OfWire(server, "wrong CRC or transaction", WireFault::kGarbage, 10),
          OfWire(server, "half an answer", WireFault::kTruncated, 2),
          OfWire(server, "exception 4", WireFault::kException, 1, 4),
          OfWire(server, "an answer 300 ms late", WireFault::kLate, 1, 300),
          {"unplugged", milliseconds(300), [&server](bool begins) {
             if (begins) {
               server.Unplug();
             } else if (absl::Status in = server.Plug(); !in.ok()) {
               spdlog::error("{}", MessageOf(in));
             }
           }}};
}

std::vector<FaultKind> DriveFaults(const std::shared_ptr<ModbusDrivePeer>& drive) {
  return {Once("drive fault 1", [drive] { drive->Fail(1); }),
          {"the position read stays", milliseconds(500), [drive](bool on) { drive->Freeze(on); }},
          {"deaf", milliseconds(500), [drive](bool on) { drive->BeDeaf(on); }},
          Once("power cycle", [drive] { drive->PowerCycle(); })};
}

DeviceOpener<Axis> ParseAxis(const std::shared_ptr<Simulation>& simulation,
                             const TomlTable& table) {
  const ModbusAxisOptions axis = ParseModbusAxisOptions(table);
  CheckLine(table, axis.line);
  DrivePeerOptions drive;
  drive.kind = table.String("profile");
  if (!ModbusDrivePeer::Knows(drive.kind)) {
    table.ErrorAt("profile",
                  absl::StrCat("\"", drive.kind, "\" is no drive that can be simulated"));
  }
  drive.role = AxisRoleOf(table);
  drive.steps_per_degree = axis.steps_per_degree;
  if (axis.steps_per_rev > 0) drive.steps_per_rev = axis.steps_per_rev;
  return [simulation, axis, drive, plan = ParseFaultPlan(table.Table("peer"))](
             const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Axis>> {
    RETURN_IF_ERROR(DeviceThread::CheckClock(context));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    ASSIGN_OR_RETURN(std::shared_ptr<ModbusDrivePeer> peer,
                     ModbusDrivePeer::Create(drive, std::move(world)));
    auto served = std::make_shared<Served>();
    ASSIGN_OR_RETURN(served->server, Serve(axis.line, {{axis.unit, peer}}));
    ASSIGN_OR_RETURN(std::unique_ptr<Axis> device, OpenModbusAxis(axis, context));
    std::vector<FaultKind> kinds = WireFaults(*served->server);
    for (FaultKind& kind : DriveFaults(peer)) kinds.push_back(std::move(kind));
    served->faults = std::make_unique<FaultPlan>(context.name, plan, std::move(kinds));
    return std::make_unique<ServedAxis>(std::move(served), std::move(device), kName);
  };
}

// A board's addresses as the peer has them: one after the other.
void CheckBoards(const TomlTable& table, const ModbusLampsOptions& lamps) {
  for (const LampBoard& board : lamps.boards) {
    for (size_t i = 1; i < board.addresses.size(); ++i) {
      if (board.addresses[i] == board.addresses[0] + static_cast<int>(i)) continue;
      table.ErrorAt("addresses", "must follow each other where the board is simulated");
      return;
    }
  }
}

DeviceOpener<Lamps> ParseLamps(const std::shared_ptr<Simulation>& simulation,
                               const TomlTable& table) {
  const ModbusLampsOptions lamps = ParseModbusLampsOptions(table);
  CheckLine(table, lamps.line);
  CheckBoards(table, lamps);
  return [simulation, lamps, plan = ParseFaultPlan(table.Table("peer"))](
             const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Lamps>> {
    RETURN_IF_ERROR(DeviceThread::CheckClock(context));
    RETURN_IF_ERROR(CheckLampCount(context, lamps.lamps()));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    ModbusServer::Devices boards;
    std::vector<FaultKind> kinds;
    LampsPeerOptions board;
    board.full = lamps.registers ? lamps.full : 0;
    board.inverted = lamps.inverted;
    for (const LampBoard& each : lamps.boards) {
      board.first_lamp += board.lamps;
      board.lamps = static_cast<int>(each.addresses.size());
      board.first_address = each.addresses.front();
      if (lamps.watchdog) {
        board.watchdog = lamps.watchdog->address;
        board.watchdog_step = lamps.watchdog->step;
      }
      auto peer = std::make_shared<ModbusLampsPeer>(board, world);
      kinds.push_back({"a lamp that sticks", milliseconds(500),
                       [peer, lamp = board.first_lamp + board.lamps / 2](bool on) {
                         peer->Stick(on ? std::optional(lamp) : std::nullopt);
                       }});
      kinds.push_back(Once("power cycle", [peer] { peer->PowerCycle(); }));
      boards[each.unit] = std::move(peer);
    }
    auto served = std::make_shared<Served>();
    ASSIGN_OR_RETURN(served->server, Serve(lamps.line, std::move(boards)));
    ASSIGN_OR_RETURN(std::unique_ptr<Lamps> device, OpenModbusLamps(lamps, context));
    for (FaultKind& kind : WireFaults(*served->server)) kinds.push_back(std::move(kind));
    served->faults = std::make_unique<FaultPlan>(context.name, plan, std::move(kinds));
    return std::make_unique<ServedLamps>(std::move(served), std::move(device), kName);
  };
}

}  // namespace

void RegisterModbusPeers(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.axes[kName].parse = [simulation](const TomlTable& table) {
    return ParseAxis(simulation, table);
  };
  registry.lamps[kName].parse = [simulation](const TomlTable& table) {
    return ParseLamps(simulation, table);
  };
}

}  // namespace lightstage::sim
