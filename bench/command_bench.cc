// What the drivers add to their wires: commands of the devices' contracts, from the call until their completion, through each driver and
// the simulated device at the other end (sim/peers), against the same exchanges on the same wire without the driver, or what the line
// itself needs. Usage: command_bench [--can INTERFACE] [--hid]
//
// Without arguments it measures what every machine has. Else these alone, through the kernel and not within the process:
//   --can INTERFACE   CANopen on this interface (vcan)
//   --hid             a DLPC350 that is a HID device of this machine (uhid)

#include <arv.h>
#include <modbus/modbus.h>
#include <spdlog/spdlog.h>

#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "base/memory.h"
#include "bench/round_trips.h"
#include "drivers/aravis/driver.h"
#include "drivers/canopen/memory_bus.h"
#include "drivers/canopen/open.h"
#include "drivers/canopen/sdo.h"
#include "drivers/canopen/socket_can.h"
#include "drivers/conformance/private_network.h"
#include "drivers/display/driver.h"
#include "drivers/display/xvfb_process.h"
#include "drivers/dlpc350/link.h"
#include "drivers/dmx/dmx_lamps.h"
#include "drivers/link/device_thread.h"
#include "drivers/modbus/driver.h"
#include "sim/peers/canopen/drive.h"
#include "sim/peers/canopen/output_module.h"
#include "sim/peers/dlpc350/in_process_port.h"
#include "sim/peers/dlpc350/uhid_device.h"
#include "sim/peers/dmx/dmx_pro.h"
#include "sim/peers/dmx/open_dmx.h"
#include "sim/peers/gige/camera_server.h"
#include "sim/peers/modbus/drive_peer.h"
#include "sim/peers/modbus/lamps_peer.h"

namespace lightstage::bench {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kLamps = 40;

// What is common to all wires: a clock, a rig, a world.
struct Stage {
  Stage() {
    for (int i = 0; i < kLamps; ++i) geometry.brace.lamps.push_back({Degrees(0), Degrees(2 * i)});
    geometry.brace.radius = Meters(1);
    geometry.brace.lamp_radius = Meters(0.02);
    geometry.projector = {
        true, Meters(1.5), Degrees(0), Degrees(20), dlpc350::kMirrorColumns, dlpc350::kMirrorRows};
    geometry.camera = {Vec3(0, -1.1, 0.55), Vec3(0, 0, 0.07), Degrees(20)};
  }
  absl::Status Build() {
    sim::WorldOptions options;
    options.scene = "balls";
    options.samples = 1;
    ASSIGN_OR_RETURN(world, sim::World::Create(options, geometry, clock));
    return MeasureHop();
  }
  // What every command of a device whose calls block takes at least.
  absl::Status MeasureHop() {
    DeviceThread thread("none", clock);
    const Call nothing = [&] {
      Pending<std::monostate> done(clock);
      auto operation = thread.Start(done.sink(), Soon(), "nothing");
      thread.Post([operation] { operation->Complete(std::monostate()); });
      return done.Wait(kNever, "nothing").status();
    };
    std::vector<double> us;
    RETURN_IF_ERROR(
        Time([&]() -> absl::StatusOr<Call> { return nothing; }, {.calls = 1000}, {}, clock, &us));
    hop_us = Percentile(us, 0.5);
    std::printf("hop, to a device's thread and back: p50 %.1f us, p99 %.1f us\n", hop_us,
                Percentile(us, 0.99));
    return absl::OkStatus();
  }
  absl::Status Print(const RoundTrip& trip) { return PrintRoundTrip(trip, hop_us, clock); }
  DeviceContext Context(const char* name) { return {name, &clock, &geometry}; }
  TimePoint Soon() { return clock.Now() + seconds(30); }

  RealClock clock;
  RigGeometry geometry;
  std::shared_ptr<sim::World> world;
  double hop_us = 0;
};

// ---- Commands of the contracts

template <class State, class Start>
absl::Status Await(Stage& stage, Start start) {
  Pending<State> done(stage.clock);
  start(stage.Soon(), done.sink());
  return done.Wait(kNever, "the command").status();
}

Call ReadsAxis(Stage& stage, std::shared_ptr<Axis> axis) {
  return [&stage, axis = std::move(axis)] {
    return Await<AxisState>(stage, [&](TimePoint deadline, Completion<AxisState> done) {
      axis->Read(deadline, std::move(done));
    });
  };
}

// All on, all off.
Call SetsLamps(Stage& stage, std::shared_ptr<Lamps> lamps) {
  return [&stage, lamps = std::move(lamps), on = false]() mutable {
    on = !on;
    return Await<LampsState>(stage, [&](TimePoint deadline, Completion<LampsState> done) {
      lamps->Set(std::vector<float>(kLamps, on ? 1.0f : 0.0f), deadline, std::move(done));
    });
  };
}

template <class Device>
Call Checks(Stage& stage, std::shared_ptr<Device> device) {
  return [&stage, device = std::move(device)] {
    return Await<std::monostate>(stage, [&](TimePoint deadline, Completion<std::monostate> done) {
      device->Check(deadline, std::move(done));
    });
  };
}

Call Shows(Stage& stage, std::shared_ptr<Projector> projector) {
  return [&stage, projector = std::move(projector), full = Pattern{}]() mutable {
    full.arrangement = PatternArrangement::kFull;
    return Await<ProjectorState>(stage, [&](TimePoint deadline, Completion<ProjectorState> done) {
      projector->Show(full, deadline, std::move(done));
    });
  };
}

// As a rig file opens it.
template <class Device>
absl::StatusOr<std::shared_ptr<Device>> Open(Stage& stage, const Driver<Device>& driver,
                                             const char* name, const std::string& table) {
  ASSIGN_OR_RETURN(TomlDocument document,
                   TomlDocument::Parse(absl::StrCat("[", name, "]\n", table), "rig.toml"));
  DeviceOpener<Device> open = driver.parse(document.root().Table(name));
  RETURN_IF_ERROR(document.Finish());
  ASSIGN_OR_RETURN(std::unique_ptr<Device> device, open(stage.Context(name)));
  return std::shared_ptr<Device>(std::move(device));
}

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
       .command = "Axis::Read",
       .through_driver = [&]() -> absl::StatusOr<Call> {
         ASSIGN_OR_RETURN(std::shared_ptr<Axis> opened, axis());
         return ReadsAxis(stage, std::move(opened));
       },
       .bare =
           [&] {
             return BareModbus(stage, *server, kDrive, {registers(2, 1), registers(0, 2)});
           }}));
  RETURN_IF_ERROR(stage.Print({.driver = name,
                               .command = "Lamps::Set, 40 coils",
                               .through_driver = [&]() -> absl::StatusOr<Call> {
                                 ASSIGN_OR_RETURN(std::shared_ptr<Lamps> opened, lamps());
                                 return SetsLamps(stage, std::move(opened));
                               },
                               .bare =
                                   [&] {
                                     return BareModbus(stage, *server, kRelays, {write, read});
                                   }}));
  return stage.Print({.driver = name,
                      .command = "Lamps::Check",
                      .through_driver = [&]() -> absl::StatusOr<Call> {
                        ASSIGN_OR_RETURN(std::shared_ptr<Lamps> opened, lamps());
                        return Checks(stage, std::move(opened));
                      },
                      .bare = [&] { return BareModbus(stage, *server, kRelays, {read}); }});
}

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

// `call` with what it stands on.
template <class Kept>
Call Keeping(std::shared_ptr<Kept> kept, Call call) {
  return [kept = std::move(kept), call = std::move(call)] { return call(); };
}

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
                   .command = "Axis::Read",
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
                               .command = "Lamps::Set, 40 outputs",
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
                      .command = "Lamps::Check",
                      .through_driver = [&]() -> absl::StatusOr<Call> {
                        ASSIGN_OR_RETURN(auto wire, wire_with(&CanWire::AddOutputs));
                        ASSIGN_OR_RETURN(std::unique_ptr<Lamps> opened, open_lamps(*wire));
                        return Keeping(wire, Checks<Lamps>(stage, std::move(opened)));
                      },
                      .bare = [&] { return bare(&CanWire::AddOutputs, 9, {check}); }});
}

// ---- DMX512

constexpr int kSlots = 512;
// Break, mark and all slots with the start code before them, as short as ANSI E1.11 lets a sender make them.
constexpr Duration kPacket = microseconds(92 + 12 + 44 * (1 + kSlots));

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

// ---- DLPC350

// Messages as the driver sent them, each with how many reports answered it.
struct Exchange {
  std::vector<dlpc350::Report> message;
  int replies = 0;
};

// Notes what goes through it.
class NotingPort final : public dlpc350::HidPort {
 public:
  NotingPort(std::unique_ptr<dlpc350::HidPort> port, std::vector<Exchange>& noted)
      : port_(std::move(port)), noted_(noted) {}
  const std::string& serial() const override { return port_->serial(); }
  absl::Status Write(const dlpc350::Report& report) override {
    if (noted_.empty() || noted_.back().replies > 0) noted_.emplace_back();
    noted_.back().message.push_back(report);
    return port_->Write(report);
  }
  absl::StatusOr<std::vector<uint8_t>> Read(Duration patience) override {
    ASSIGN_OR_RETURN(std::vector<uint8_t> report, port_->Read(patience));
    if (!report.empty()) ++noted_.back().replies;
    return report;
  }

 private:
  const std::unique_ptr<dlpc350::HidPort> port_;
  std::vector<Exchange>& noted_;
};

absl::Status Repeat(dlpc350::HidPort& port, const std::vector<Exchange>& exchanges) {
  for (const Exchange& exchange : exchanges) {
    for (const dlpc350::Report& report : exchange.message) RETURN_IF_ERROR(port.Write(report));
    for (int i = 0; i < exchange.replies; ++i) {
      ASSIGN_OR_RETURN(const std::vector<uint8_t> reply, port.Read(seconds(5)));
      if (reply.empty()) return absl::DeadlineExceededError("no reply from the projector");
    }
  }
  return absl::OkStatus();
}

absl::Status MeasureDlpc350(Stage& stage, bool hid) {
  Pattern full;
  full.arrangement = PatternArrangement::kFull;
  dlpc350::Options options;
  options.flash = true;
  options.current = {50, 60, 70};
  options.exposure_us = options.period_us = 8400;
  options.patterns[full] = {0, 24, 1, false};
  sim::Dlpc350Device device(stage.world, {{sim::FlashPlace(0, 24, 1), full}});
  std::unique_ptr<sim::UhidDevice> plugged;
  dlpc350::HidOpener port = sim::InProcessHid(device, "BENCH1");
  if (hid) {
    ASSIGN_OR_RETURN(plugged, sim::UhidDevice::Plug(device, "BENCH1"));
    port = [] { return dlpc350::OpenHidDevice("", "BENCH1"); };
  }
  auto open = [&](const dlpc350::HidOpener& opener) {
    return OpenLinkedProjector(
        stage.Context("projector"), "dlpc350",
        std::make_unique<dlpc350::Link>(stage.Context("projector"), options, opener, nullptr));
  };
  // What a command is on the wire is noted once.
  std::vector<Exchange> noted, opening;
  auto note = [&](auto command) -> absl::StatusOr<std::vector<Exchange>> {
    noted.clear();
    ASSIGN_OR_RETURN(std::shared_ptr<Projector> projector,
                     open([&]() -> absl::StatusOr<std::unique_ptr<dlpc350::HidPort>> {
                       ASSIGN_OR_RETURN(auto noting, port());
                       return std::make_unique<NotingPort>(std::move(noting), noted);
                     }));
    RETURN_IF_ERROR(Shows(stage, projector)());
    opening = std::exchange(noted, {});
    RETURN_IF_ERROR(command(stage, projector)());
    return std::exchange(noted, {});
  };
  ASSIGN_OR_RETURN(const std::vector<Exchange> show, note(Shows));
  ASSIGN_OR_RETURN(const std::vector<Exchange> check, note(Checks<Projector>));
  auto bare = [&](const std::vector<Exchange>& command) -> absl::StatusOr<Call> {
    ASSIGN_OR_RETURN(std::shared_ptr<dlpc350::HidPort> opened, port());
    RETURN_IF_ERROR(Repeat(*opened, opening));
    return [opened, &command] { return Repeat(*opened, command); };
  };
  const char* const name = hid ? "dlpc350, uhid" : "dlpc350, process";
  RETURN_IF_ERROR(stage.Print({.driver = name,
                               .command = "Projector::Show, flash",
                               .calls = 100,
                               .through_driver = [&]() -> absl::StatusOr<Call> {
                                 ASSIGN_OR_RETURN(auto projector, open(port));
                                 return Shows(stage, std::move(projector));
                               },
                               .bare = [&] { return bare(show); },
                               .line = microseconds(options.period_us)}));
  return stage.Print({.driver = name,
                      .command = "Projector::Check",
                      .through_driver = [&]() -> absl::StatusOr<Call> {
                        ASSIGN_OR_RETURN(std::shared_ptr<Projector> projector, open(port));
                        RETURN_IF_ERROR(Shows(stage, projector)());
                        return Checks(stage, std::move(projector));
                      },
                      .bare = [&] { return bare(check); }});
}

// ---- Display

absl::Status MeasureDisplay(Stage& stage) {
  constexpr int kFrames = 2;
  constexpr double kRefreshHz = 60;  // the server does not tell another
  ASSIGN_OR_RETURN(XvfbProcess server, XvfbProcess::Start(stage.geometry.projector.width,
                                                          stage.geometry.projector.height));
  return stage.Print(
      {.driver = "display, Xvfb",
       .command = "Projector::Show",
       .calls = 60,
       .through_driver = [&]() -> absl::StatusOr<Call> {
         ASSIGN_OR_RETURN(
             std::shared_ptr<Projector> projector,
             Open(stage, DisplayDriver(), "projector",
                  absl::StrCat("output_index = 0\nrenderer = \"software\"\nframes = ", kFrames,
                               "\nx_display = \"", server.display(), "\"\n")));
         return Shows(stage, std::move(projector));
       },
       .line = FromSeconds(kFrames / kRefreshHz)});
}

// ---- GigE Vision

constexpr char kAddress[] = "127.0.0.1";
constexpr int kWidth = 64, kHeight = 48;
constexpr Duration kExposure = milliseconds(1);

absl::StatusOr<Call> TakesFrames(Stage& stage) {
  ASSIGN_OR_RETURN(std::shared_ptr<Camera> camera,
                   Open(stage, AravisDriver(), "camera",
                        absl::StrCat("address = \"", kAddress, "\"\npacket_size = 7000\n")));
  RETURN_IF_ERROR(
      Await<CameraConfig>(stage, [&](TimePoint deadline, Completion<CameraConfig> done) {
        camera->Configure({PixelFormat::kMono8, kWidth, kHeight, camera->info().min_gain_db},
                          deadline, std::move(done));
      }));
  RETURN_IF_ERROR(
      Await<CameraConfig>(stage, [&](TimePoint deadline, Completion<CameraConfig> done) {
        camera->Arm(deadline, std::move(done));
      }));
  return [&stage, camera] {
    return Await<Frame>(stage, [&](TimePoint deadline, Completion<Frame> done) {
      camera->Trigger(
          kExposure, deadline, [](absl::StatusOr<ExposureEnd>) {}, std::move(done));
    });
  };
}

// libaravis and nothing else.
absl::StatusOr<Call> BareAravis() {
  const auto refused = [](GError* error) {
    absl::Status status = absl::UnavailableError(error->message);
    g_error_free(error);
    return status;
  };
  GError* error = nullptr;
  const auto release = [](auto* object) {
    if (object != nullptr) g_object_unref(object);
  };
  std::shared_ptr<ArvCamera> camera(arv_camera_new(kAddress, &error), release);
  if (error == nullptr) arv_camera_gv_set_packet_size(camera.get(), 7000, &error);
  if (error == nullptr) arv_camera_set_region(camera.get(), 0, 0, kWidth, kHeight, &error);
  if (error == nullptr) {
    arv_camera_set_exposure_time(camera.get(), Seconds(kExposure) * 1e6, &error);
  }
  if (error == nullptr) arv_camera_set_trigger(camera.get(), "Software", &error);
  if (error != nullptr) return refused(error);
  arv_camera_gv_set_stream_options(camera.get(), ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  std::shared_ptr<ArvStream> stream(
      arv_camera_create_stream(camera.get(), nullptr, nullptr, &error), release);
  if (error == nullptr) {
    const size_t payload = arv_camera_get_payload(camera.get(), &error);
    for (int i = 0; i < 4; ++i) {
      arv_stream_push_buffer(stream.get(), arv_buffer_new(payload, nullptr));
    }
  }
  if (error == nullptr) arv_camera_start_acquisition(camera.get(), &error);
  if (error != nullptr) return refused(error);
  // The stream goes before its camera, which must be told.
  std::shared_ptr<void> acquisition(
      nullptr, [camera](void*) { arv_camera_stop_acquisition(camera.get(), nullptr); });
  return [camera, stream, acquisition, refused]() -> absl::Status {
    GError* wrong = nullptr;
    arv_camera_software_trigger(camera.get(), &wrong);
    if (wrong != nullptr) return refused(wrong);
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream.get(), 5'000'000);
    if (buffer == nullptr) return absl::DeadlineExceededError("no frame from the camera");
    arv_stream_push_buffer(stream.get(), buffer);
    return absl::OkStatus();
  };
}

absl::Status MeasureAravis(Stage& stage) {
  ASSIGN_OR_RETURN(const auto server,
                   sim::GigeCameraServer::Start(
                       {.address = kAddress, .width = kWidth, .height = kHeight}, stage.world));
  return stage.Print({.driver = "aravis, sim-gige",
                      .command = "Camera::Trigger, frame",
                      .calls = 200,
                      .through_driver = [&] { return TakesFrames(stage); },
                      .bare = BareAravis,
                      .exposure = kExposure});
}

absl::Status Measure(const std::string& can_interface, bool hid) {
  Stage stage;
  RETURN_IF_ERROR(stage.Build());
  PrintRoundTripHeader();
  if (!can_interface.empty()) RETURN_IF_ERROR(MeasureCanopen(stage, can_interface));
  if (hid) RETURN_IF_ERROR(MeasureDlpc350(stage, hid));
  if (hid || !can_interface.empty()) return absl::OkStatus();
  RETURN_IF_ERROR(MeasureModbus(stage, /*tcp=*/true));
  RETURN_IF_ERROR(MeasureModbus(stage, /*tcp=*/false));
  RETURN_IF_ERROR(MeasureCanopen(stage, ""));
  RETURN_IF_ERROR(MeasureDlpc350(stage, /*hid=*/false));
  RETURN_IF_ERROR(MeasureAravis(stage));
  RETURN_IF_ERROR(MeasureDisplay(stage));
  RETURN_IF_ERROR(MeasureDmx(stage, dmx::WidgetKind::kOpen));
  return MeasureDmx(stage, dmx::WidgetKind::kPro);
}

}  // namespace
}  // namespace lightstage::bench

int main(int argc, char** argv) {
  spdlog::set_level(spdlog::level::err);
  lightstage::KeepFrameMemory();  // as the daemon does
  std::string can_interface;
  bool hid = false;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--hid") == 0) {
      hid = true;
    } else if (std::strcmp(argv[i], "--can") == 0 && i + 1 < argc) {
      can_interface = argv[++i];
    } else {
      return std::fprintf(stderr, "usage: command_bench [--can INTERFACE] [--hid]\n"), 2;
    }
  }
  // GigE Vision's port is fixed; an interface of the kernel is in the network that the machine has.
  if (can_interface.empty()) lightstage::EnterPrivateNetwork();
  absl::Status measured = lightstage::bench::Measure(can_interface, hid);
  if (!measured.ok()) std::fprintf(stderr, "%s\n", lightstage::MessageOf(measured).c_str());
  return measured.ok() ? 0 : 1;
}
