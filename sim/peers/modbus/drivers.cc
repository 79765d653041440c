#include "sim/peers/modbus/drivers.h"

#include <utility>

#include "base/status.h"
#include "drivers/modbus/driver.h"
#include "drivers/modbus/options.h"
#include "sim/peers/modbus/drive_peer.h"
#include "sim/peers/modbus/lamps_peer.h"
#include "sim/peers/modbus/server.h"
#include "sim/rig/served.h"

namespace lightstage::sim {
namespace {

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
  return [simulation, axis, drive, connect = ModbusAxisDriver().parse(table)](
             const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Axis>> {
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    ASSIGN_OR_RETURN(std::shared_ptr<ModbusDrivePeer> peer,
                     ModbusDrivePeer::Create(drive, std::move(world)));
    ASSIGN_OR_RETURN(std::unique_ptr<ModbusServer> server,
                     Serve(axis.line, {{axis.unit, std::move(peer)}}));
    ASSIGN_OR_RETURN(std::unique_ptr<Axis> device, connect(context));
    return std::make_unique<ServedAxis>(std::move(server), std::move(device), kName);
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
  return [simulation, lamps, connect = ModbusLampsDriver().parse(table)](
             const DeviceContext& context) mutable -> absl::StatusOr<std::unique_ptr<Lamps>> {
    RETURN_IF_ERROR(CheckLampCount(context, lamps.lamps()));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    ModbusServer::Devices boards;
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
      boards[each.unit] = std::make_shared<ModbusLampsPeer>(board, world);
    }
    ASSIGN_OR_RETURN(std::unique_ptr<ModbusServer> server, Serve(lamps.line, std::move(boards)));
    ASSIGN_OR_RETURN(std::unique_ptr<Lamps> device, connect(context));
    return std::make_unique<ServedLamps>(std::move(server), std::move(device), kName);
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
