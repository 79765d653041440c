#include "bench/buses.h"

#include <modbus/modbus.h>

#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "drivers/canopen/memory_bus.h"
#include "drivers/canopen/open.h"
#include "drivers/canopen/sdo.h"
#include "drivers/canopen/socket_can.h"
#include "drivers/dmx/dmx_lamps.h"
#include "drivers/modbus/driver.h"
#include "sim/peers/canopen/drive.h"
#include "sim/peers/canopen/output_module.h"
#include "sim/peers/dmx/dmx_pro.h"
#include "sim/peers/dmx/open_dmx.h"
#include "sim/peers/modbus/drive_peer.h"
#include "sim/peers/modbus/lamps_peer.h"

namespace lightstage::bench {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

// ---- Modbus

// Between two frames of a serial line (MODBUS over Serial Line V1.02, 2.5.1.1), at 115200 baud.
constexpr Duration kSilence = microseconds(1750);
constexpr int kDrive = 5, kRelays = 1, kFirstCoil = 16;

// libmodbus and nothing else. `ask` returns −1 if it failed.
absl::StatusOr<Call> BareModbus(Stage& stage, const sim::ModbusServer& server, int unit,
                                std::vector<std::function<int(modbus_t*)>> asks) {
  const bool tcp = server.port() > 0;
  std::shared_ptr<modbus_t> context(
      tcp ? modbus_new_tcp("127.0.0.1", server.port())
          : modbus_new_rtu(server.serial_port().c_str(), 115200, 'N', 8, 1),
      [](modbus_t* opened) {
        modbus_close(opened);
        modbus_free(opened);
      });
  if (modbus_connect(context.get()) != 0) return absl::UnavailableError(modbus_strerror(errno));
  modbus_set_slave(context.get(), unit);
  return [&stage, tcp, context, asks = std::move(asks)]() mutable -> absl::Status {
    for (auto& ask : asks) {
      if (!tcp) SleepFor(stage.clock, kSilence);
      if (ask(context.get()) < 0) return absl::UnavailableError(modbus_strerror(errno));
    }
    return absl::OkStatus();
  };
}

}  // namespace

absl::Status MeasureModbus(Stage& stage, bool tcp) {
  ASSIGN_OR_RETURN(auto drive, sim::ModbusDrivePeer::Create({}, stage.world));
  auto relays = std::make_shared<sim::ModbusLampsPeer>(
      sim::LampsPeerOptions{.lamps = kLamps, .first_address = kFirstCoil}, stage.world);
  sim::ModbusServer::Devices devices = {{kDrive, drive}, {kRelays, relays}};
  ASSIGN_OR_RETURN(std::unique_ptr<sim::ModbusServer> server,
                   tcp ? sim::ModbusServer::StartTcp(std::move(devices))
                       : sim::ModbusServer::StartRtu(std::move(devices)));
  const std::string line = tcp ? absl::StrCat("host = \"127.0.0.1\"\nport = ", server->port(), "\n")
                               : absl::StrCat("serial_port = \"", server->serial_port(),
                                              "\"\nbaud = 115200\nparity = \"none\"\n");
  auto axis = [&] {
    return Open(stage, ModbusAxisDriver(), "turntable",
                absl::StrCat(line, "unit = ", kDrive,
                             "\nprofile = \"generic\"\nsteps_per_degree = 1000\n"
                             "continuous = true\nmax_velocity_dps = 400\n"
                             "max_acceleration_dps2 = 4000\n"));
  };
  auto lamps = [&] {
    return Open(stage, ModbusLampsDriver(), "lamps",
                absl::StrCat(line, "kind = \"coils\"\nsettle_ms = 0\n[[lamps.board]]\nunit = ",
                             kRelays, "\nfirst = ", kFirstCoil, "\ncount = ", kLamps, "\n"));
  };
  auto registers = [](int first, int count) {
    return [=](modbus_t* context) {
      uint16_t values[2];
      return modbus_read_registers(context, first, count, values);
    };
  };
  auto write = [on = false](modbus_t* context) mutable {
    on = !on;
    const std::vector<uint8_t> coils(kLamps, on ? 1 : 0);
    return modbus_write_bits(context, kFirstCoil, kLamps, coils.data());
  };
  auto read = [](modbus_t* context) {
    uint8_t coils[kLamps];
    return modbus_read_bits(context, kFirstCoil, kLamps, coils);
  };
  const char* const name = tcp ? "modbus TCP" : "modbus RTU, pty";
  RETURN_IF_ERROR(stage.Print(
      {.driver = name,
       .command = "Axis::Read, 2 requests",
       .through_driver = [&]() -> absl::StatusOr<Call> {
         ASSIGN_OR_RETURN(std::shared_ptr<Axis> opened, axis());
         return ReadsAxis(stage, std::move(opened));
       },
       .bare =
           [&] {
             return BareModbus(stage, *server, kDrive, {registers(2, 1), registers(0, 2)});
           }}));
  RETURN_IF_ERROR(stage.Print({.driver = name,
                               .command = "Lamps::Set, 2 requests",
                               .through_driver = [&]() -> absl::StatusOr<Call> {
                                 ASSIGN_OR_RETURN(std::shared_ptr<Lamps> opened, lamps());
                                 return SetsLamps(stage, std::move(opened));
                               },
                               .bare =
                                   [&] {
                                     return BareModbus(stage, *server, kRelays, {write, read});
                                   }}));
  return stage.Print({.driver = name,
                      .command = "Lamps::Check, 1 request",
                      .through_driver = [&]() -> absl::StatusOr<Call> {
                        ASSIGN_OR_RETURN(std::shared_ptr<Lamps> opened, lamps());
                        return Checks(stage, std::move(opened));
                      },
                      .bare = [&] { return BareModbus(stage, *server, kRelays, {read}); }});
}

namespace {

// ---- CANopen

template <class Options>
absl::StatusOr<Options> Parsed(const std::string& toml, Options (*parse)(const TomlTable&)) {
  ASSIGN_OR_RETURN(TomlDocument document, TomlDocument::Parse(toml, "rig.toml"));
  Options options = parse(document.root());
  RETURN_IF_ERROR(document.Finish());
  return options;
}

constexpr char kTurntable[] =
    "interface = \"can0\"\nnode = 5\ncontinuous = true\nunits_per_turn = 36000\n"
    "max_velocity_dps = 360\nmax_acceleration_dps2 = 3600\nhoming_method = 19\n"
    "homing_velocity_dps = 360\n";
constexpr char kOutputs[] = "interface = \"can0\"\nnode = 9\noutput = \"digital\"\nsettle_ms = 0\n";

using SdoRequests = std::vector<canopen::SdoBytes>;

// A wire with one node and one more end, made anew for each measurement: the driver's bus or the bare port.
class CanWire {
 public:
  CanWire(Stage& stage, std::string interface)
      : stage_(stage), interface_(std::move(interface)), memory_(stage.clock) {}

  absl::StatusOr<std::unique_ptr<canopen::CanPort>> Attach() {
    if (!interface_.empty()) return canopen::OpenSocketCan(interface_, stage_.clock);
    return memory_.Attach();
  }
  absl::Status AddDrive() {
    ASSIGN_OR_RETURN(auto port, Attach());
    drive_ =
        std::make_unique<sim::CanopenDrive>(std::move(port), sim::DriveOptions{}, stage_.world);
    return absl::OkStatus();
  }
  absl::Status AddOutputs() {
    ASSIGN_OR_RETURN(auto port, Attach());
    outputs_ = std::make_unique<sim::CanopenOutputModule>(
        std::move(port), sim::OutputModuleOptions{.outputs = kLamps}, stage_.world);
    return absl::OkStatus();
  }
  std::shared_ptr<canopen::CanBus> Bus() {
    return std::make_shared<canopen::CanBus>("can0", stage_.clock, [this] { return Attach(); });
  }
  // Sends each frame to the node and waits for its answer; another one of `commands` each time.
  absl::StatusOr<Call> Bare(int node, std::vector<SdoRequests> commands) {
    ASSIGN_OR_RETURN(std::shared_ptr<canopen::CanPort> port, Attach());
    return
        [port, node, commands = std::move(commands), turn = size_t{0}]() mutable -> absl::Status {
          for (const canopen::SdoBytes& request : commands[turn++ % commands.size()]) {
            RETURN_IF_ERROR(
                port->Send(canopen::MakeFrame(static_cast<uint16_t>(0x600 + node), request)));
            std::optional<canopen::CanEvent> event;
            do {
              ASSIGN_OR_RETURN(event, port->Receive(seconds(5)));
              if (!event) return absl::DeadlineExceededError("the node does not answer");
            } while (event->frame.id != 0x580 + node);
          }
          return absl::OkStatus();
        };
  }

 private:
  Stage& stage_;
  const std::string interface_;  // empty: within the process
  canopen::MemoryBus memory_;
  std::unique_ptr<sim::CanopenDrive> drive_;
  std::unique_ptr<sim::CanopenOutputModule> outputs_;
};

}  // namespace

absl::Status MeasureCanopen(Stage& stage, const std::string& interface) {
  ASSIGN_OR_RETURN(const canopen::AxisOptions axis, Parsed(kTurntable, canopen::ParseAxisOptions));
  ASSIGN_OR_RETURN(const canopen::LampsOptions lamps, Parsed(kOutputs, canopen::ParseLampsOptions));
  auto wire_with = [&](absl::Status (CanWire::*add)()) -> absl::StatusOr<std::shared_ptr<CanWire>> {
    auto wire = std::make_shared<CanWire>(stage, interface);
    RETURN_IF_ERROR((wire.get()->*add)());
    return wire;
  };
  auto open_lamps = [&](CanWire& wire) {
    return canopen::OpenLamps(stage.Context("lamps"), "canopen", lamps, wire.Bus());
  };
  auto bare = [&](absl::Status (CanWire::*add)(), int node,
                  std::vector<SdoRequests> commands) -> absl::StatusOr<Call> {
    ASSIGN_OR_RETURN(std::shared_ptr<CanWire> wire, wire_with(add));
    ASSIGN_OR_RETURN(Call call, wire->Bare(node, std::move(commands)));
    return Keeping(wire, std::move(call));
  };
  // Eight lamps an object.
  SdoRequests light, darken, check;
  for (uint8_t sub = 1; sub <= kLamps / 8; ++sub) {
    const canopen::ObjectAddress object{0x6200, sub};
    for (auto [requests, value] : {std::pair(&light, uint8_t{0xFF}), {&darken, uint8_t{0}}}) {
      requests->push_back(canopen::EncodeDownload(object, {&value, 1}));
      requests->push_back(canopen::EncodeUpload(object));
    }
    check.push_back(canopen::EncodeUpload(object));
  }
  const char* const name = interface.empty() ? "canopen, process" : "canopen, SocketCAN";
  // Status and position come by themselves (TPDO 1); the velocity is asked for.
  RETURN_IF_ERROR(
      stage.Print({.driver = name,
                   .command = "Axis::Read, 1 SDO",
                   .through_driver = [&]() -> absl::StatusOr<Call> {
                     ASSIGN_OR_RETURN(auto wire, wire_with(&CanWire::AddDrive));
                     ASSIGN_OR_RETURN(std::unique_ptr<Axis> opened,
                                      canopen::OpenAxis(stage.Context("turntable"), "canopen", axis,
                                                        wire->Bus()));
                     return Keeping(wire, ReadsAxis(stage, std::move(opened)));
                   },
                   .bare =
                       [&] {
                         return bare(&CanWire::AddDrive, 5, {{canopen::EncodeUpload({0x606C, 0})}});
                       }}));
  RETURN_IF_ERROR(stage.Print({.driver = name,
                               .command = "Lamps::Set, 10 SDOs",
                               .through_driver = [&]() -> absl::StatusOr<Call> {
                                 ASSIGN_OR_RETURN(auto wire, wire_with(&CanWire::AddOutputs));
                                 ASSIGN_OR_RETURN(std::unique_ptr<Lamps> opened, open_lamps(*wire));
                                 return Keeping(wire, SetsLamps(stage, std::move(opened)));
                               },
                               .bare =
                                   [&] {
                                     return bare(&CanWire::AddOutputs, 9, {light, darken});
                                   }}));
  return stage.Print({.driver = name,
                      .command = "Lamps::Check, 5 SDOs",
                      .through_driver = [&]() -> absl::StatusOr<Call> {
                        ASSIGN_OR_RETURN(auto wire, wire_with(&CanWire::AddOutputs));
                        ASSIGN_OR_RETURN(std::unique_ptr<Lamps> opened, open_lamps(*wire));
                        return Keeping(wire, Checks<Lamps>(stage, std::move(opened)));
                      },
                      .bare = [&] { return bare(&CanWire::AddOutputs, 9, {check}); }});
}

namespace {

// ---- DMX512

constexpr int kSlots = 512;
// Break, mark and all slots with the start code before them, as short as ANSI E1.11 lets a sender make them.
constexpr Duration kPacket = microseconds(92 + 12 + 44 * (1 + kSlots));

}  // namespace

absl::Status MeasureDmx(Stage& stage, dmx::WidgetKind kind) {
  const bool open = kind == dmx::WidgetKind::kOpen;
  dmx::DmxOptions options;
  options.widget = kind;
  options.channels.slots = kSlots;
  for (int i = 0; i < kLamps; ++i) options.channels.first.push_back(1 + i);
  options.device.serial = "LAMPS01";
  const sim::DmxFixtureOptions fixtures = {.first_channels = options.channels.first,
                                           .slots = kSlots};
  const dmx::UsbIdentity identity = {.product = open ? "FT232R USB UART" : "DMX USB PRO",
                                     .serial = "LAMPS01"};
  const CallOpener set = [&]() -> absl::StatusOr<Call> {
    std::shared_ptr<sim::SimUsbDevice> widget;
    if (open) {
      widget = std::make_shared<sim::OpenDmx>(identity, stage.clock, fixtures, stage.world);
    } else {
      widget = std::make_shared<sim::DmxPro>(identity, stage.clock, sim::DmxProOptions{}, fixtures,
                                             stage.world);
    }
    ASSIGN_OR_RETURN(
        std::unique_ptr<Lamps> lamps,
        dmx::OpenDmxLamps(options, stage.Context("lamps"), sim::MakeSimUsbBus({widget})));
    return Keeping(widget, SetsLamps(stage, std::move(lamps)));
  };
  // A pro sends by itself, and where it is in a packet nobody can know: at worst the next one is the first with what is new.
  if (!open) {
    return stage.Print(
        {.driver = "dmx pro",
         .command = "Lamps::Set",
         .calls = 60,
         .through_driver = set,
         .line = kPacket + FromSeconds(1.0 / sim::DmxProOptions().packets_per_second)});
  }
  RETURN_IF_ERROR(stage.Print({.driver = "dmx open",
                               .command = "Lamps::Set, at once",
                               .calls = 60,
                               .through_driver = set,
                               .line = kPacket}));
  return stage.Print({.driver = "dmx open",
                      .command = "Lamps::Set, at any time",
                      .calls = 60,
                      .through_driver = set,
                      .line = kPacket,
                      .pause = milliseconds(100)});
}

}  // namespace lightstage::bench
