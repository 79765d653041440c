// The same over the kernel's CAN: for a machine that has it, e.g. a virtual one with vcan or two coupled kvaser_pci cards. Not among the usual
// tests: build the target vm_test_canopen and set
//
//   LIGHTSTAGE_CAN_INTERFACE       the driver's interface, up
//   LIGHTSTAGE_CAN_PEER_INTERFACE  the simulated nodes' on the same wire; not set: the same interface (vcan)
//
// Needs the right to set the interface down and up.
#include <gmock/gmock.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "drivers/canopen/can_bus.h"
#include "drivers/canopen/discovery.h"
#include "drivers/canopen/driver.h"
#include "drivers/canopen/socket_can.h"
#include "drivers/conformance/fixtures.h"
#include "sim/peers/canopen/test_bench.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

std::string Variable(const char* name, std::string otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr ? otherwise : value;
}
std::string Interface() {
  return Variable("LIGHTSTAGE_CAN_INTERFACE", "LIGHTSTAGE_CAN_INTERFACE-is-not-set");
}
std::string PeerInterface() { return Variable("LIGHTSTAGE_CAN_PEER_INTERFACE", Interface()); }

std::string OnInterface(std::string toml) {
  return "interface = \"" + Interface() + "\"\nanswer_ms = 1000\nheartbeat_ms = 4000\n" + toml;
}

// What the driver's controller tells of itself (linux/can/error.h), said in its stead: virtual ones never fail. It comes to all who listen on the
// interface; nodes that share it (vcan) take no notice.
void Report(canid_t error) {
  const int socket = ::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(if_nametoindex(Interface().c_str()));
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG | error;
  frame.can_dlc = CAN_ERR_DLC;
  EXPECT_EQ(sendto(socket, &frame, sizeof frame, 0, reinterpret_cast<const sockaddr*>(&address),
                   sizeof address),
            static_cast<ssize_t>(sizeof frame));
  close(socket);
}

void Restart() {
  Report(CAN_ERR_RESTARTED);
  const auto bus = canopen::CanBus::Find(Interface());
  RealClock clock;
  const TimePoint late = clock.Now() + seconds(20);
  while (!bus->trouble().ok() && clock.Now() < late) SleepFor(clock, milliseconds(2));
  EXPECT_TRUE(bus->trouble().ok()) << bus->trouble();
}

// Of so many tries one must not have been held up by the machine.
constexpr int kTries = 5;
constexpr Duration kAtOnce = milliseconds(100);

bool IsBusOff(const absl::Status& lost) {
  return lost.code() == absl::StatusCode::kUnavailable && ErrorReason(lost) == "DEVICE_LOST" &&
         MessageOf(lost).find(Interface() + " is bus-off") != std::string::npos;
}

// The simulated nodes on the kernel's wire, and the driver as a rig file opens it.
class VmBench {
 public:
  VmBench() {
    WorldOptions options;
    options.samples = 1;
    options.scene = "balls";  // soon built, also where everything is emulated
    world_ = *World::Create(options, geometry_, clock_);
  }
  absl::Status AddNodes(bool drive, bool outputs) {
    if (drive) {
      ASSIGN_OR_RETURN(auto port, canopen::OpenSocketCan(PeerInterface(), clock_));
      drive_ = std::make_unique<CanopenDrive>(std::move(port), DriveOptions{}, world_);
    }
    if (outputs) {
      ASSIGN_OR_RETURN(auto port, canopen::OpenSocketCan(PeerInterface(), clock_));
      outputs_ =
          std::make_unique<CanopenOutputModule>(std::move(port), OutputModuleOptions{}, world_);
    }
    return absl::OkStatus();
  }
  template <class Device>
  absl::StatusOr<std::unique_ptr<Device>> Open(const Driver<Device>& driver,
                                               const std::string& toml, const char* name) {
    ASSIGN_OR_RETURN(TomlDocument document, TomlDocument::Parse(toml, "rig.toml"));
    DeviceOpener<Device> open = driver.parse(document.root());
    RETURN_IF_ERROR(document.Finish());
    return open({name, &clock_, &geometry_});
  }
  Clock& clock() { return clock_; }
  World& world() { return *world_; }
  CanopenDrive& drive() { return *drive_; }
  void RemoveDrive() { drive_.reset(); }

 private:
  RealClock clock_;
  const RigGeometry geometry_ = Rig();
  std::shared_ptr<World> world_;
  std::unique_ptr<CanopenDrive> drive_;
  std::unique_ptr<CanopenOutputModule> outputs_;
};

struct AxisOnWire : AxisFixture {
  Clock& clock() override { return bench.clock(); }
  absl::StatusOr<std::unique_ptr<Axis>> Open() override {
    RETURN_IF_ERROR(bench.AddNodes(true, false));
    return bench.Open(CanopenAxisDriver(), OnInterface(kTurntable), "turntable");
  }
  VmBench bench;
};

struct LampsOnWire : LampsFixture {
  Clock& clock() override { return bench.clock(); }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() override {
    RETURN_IF_ERROR(bench.AddNodes(false, true));
    return bench.Open(CanopenLampsDriver(), OnInterface(kDigitalLamps), "lamps");
  }
  std::optional<std::vector<float>> Emitted() override {
    return bench.world().LampLevels(bench.clock().Now());
  }
  VmBench bench;
};

[[maybe_unused]] const bool kRegistered =
    RegisterAxisConformance("SocketCan", [] { return std::make_unique<AxisOnWire>(); }) &&
    RegisterLampsConformance("SocketCan", [] { return std::make_unique<LampsOnWire>(); });

TEST(SocketCanVm, FramesCrossTheWireInOrderWithTheirTime) {
  RealClock clock;
  auto a = canopen::OpenSocketCan(Interface(), clock);
  auto b = canopen::OpenSocketCan(PeerInterface(), clock);
  ASSERT_TRUE(a.ok()) << a.status();
  ASSERT_TRUE(b.ok()) << b.status();
  EXPECT_EQ((*a)->state(), canopen::CanState::kActive);
  const TimePoint before = clock.Now();
  // No faster than they are taken: a card holds only a few.
  for (int i = 0; i < 200; ++i) {
    const uint8_t bytes[] = {static_cast<uint8_t>(i), 2, 3};
    ASSERT_TRUE((*a)->Send(canopen::MakeFrame(0x123, bytes)).ok()) << i;
    auto event = (*b)->Receive(seconds(5));
    ASSERT_TRUE(event.ok()) << event.status();
    ASSERT_TRUE(event->has_value()) << i;
    EXPECT_EQ((*event)->frame.id, 0x123);
    EXPECT_EQ((*event)->frame.size, 3);
    EXPECT_EQ((*event)->frame.data[0], i);
    EXPECT_GE((*event)->time, before - milliseconds(50));
    EXPECT_LE((*event)->time, clock.Now());
  }
  auto nothing = (*b)->Receive(milliseconds(20));
  ASSERT_TRUE(nothing.ok()) << nothing.status();
  EXPECT_FALSE(nothing->has_value());
}

TEST(SocketCanVm, DiscoveryFindsNodesAndSkipsABusInUse) {
  VmBench bench;
  ASSERT_TRUE(bench.AddNodes(true, true).ok());
  auto what = [] {
    absl::StatusOr<std::vector<Discovered>> found = CanopenDiscovery()();
    EXPECT_TRUE(found.ok()) << found.status();
    std::string all;
    for (const Discovered& one : *found) all += one.what + "\n";
    return all;
  };
  EXPECT_THAT(what(), testing::AllOf(HasSubstr("node 5 on " + Interface() + ": a CiA 402 drive"),
                                     HasSubstr("node 9 on " + Interface())));
  auto axis = bench.Open(CanopenAxisDriver(), OnInterface(kTurntable), "turntable");
  ASSERT_TRUE(axis.ok()) << axis.status();
  EXPECT_THAT(what(), HasSubstr(Interface() + ": in use"));
}

// An interface that is set down is noticed at once, and opened anew by homing when it is back.
TEST(SocketCanVm, InterfaceThatGoesDownIsLost) {
  VmBench bench;
  ASSERT_TRUE(bench.AddNodes(true, false).ok());
  auto axis = bench.Open(CanopenAxisDriver(), OnInterface(kTurntable), "turntable");
  ASSERT_TRUE(axis.ok()) << axis.status();
  ASSERT_EQ(std::system(("ip link set " + Interface() + " down").c_str()), 0);
  auto read = [&] {
    Pending<AxisState> done(bench.clock());
    (*axis)->Read(bench.clock().Now() + seconds(20), done.sink());
    return done.Wait(kNever, "Read").status();
  };
  absl::Status lost = read();
  for (int i = 0; i < 200 && ErrorReason(lost) != "DEVICE_LOST"; ++i) {
    SleepFor(bench.clock(), milliseconds(10));
    lost = read();
  }
  EXPECT_EQ(ErrorReason(lost), "DEVICE_LOST") << lost;
  ASSERT_EQ(std::system(("ip link set " + Interface() + " up").c_str()), 0);
  bench.RemoveDrive();  // its own socket saw the same
  ASSERT_TRUE(bench.AddNodes(true, false).ok());
  Pending<AxisState> homed(bench.clock());
  (*axis)->Home(bench.clock().Now() + seconds(20), homed.sink());
  const absl::Status home = homed.Wait(kNever, "Home").status();
  EXPECT_TRUE(home.ok()) << home;
}

TEST(SocketCanVm, BusOffEndsTheMoveAtOnceAndComesBackByHoming) {
  VmBench bench;
  ASSERT_TRUE(bench.AddNodes(true, false).ok());
  auto axis = bench.Open(CanopenAxisDriver(), OnInterface(kTurntable), "turntable");
  ASSERT_TRUE(axis.ok()) << axis.status();
  auto soon = [&] { return bench.clock().Now() + seconds(60); };
  auto home = [&] {
    Pending<AxisState> done(bench.clock());
    (*axis)->Home(soon(), done.sink());
    return done.Wait(kNever, "Home").status();
  };
  auto move = [&](double degrees) {
    Pending<AxisState> done(bench.clock());
    (*axis)->Move(Degrees(degrees), 20, soon(), done.sink());
    return done;
  };
  Duration shortest = Duration::max();
  for (int i = 0; i < kTries; ++i) {
    absl::Status homed = home();
    ASSERT_TRUE(homed.ok()) << homed;
    auto moving = move(170);
    while (!bench.world().AxisAt(AxisRole::kTurntable, bench.clock().Now()).moving) {
      ASSERT_FALSE(moving.done());
      SleepFor(bench.clock(), milliseconds(2));
    }
    const TimePoint off = bench.clock().Now();
    Report(CAN_ERR_BUSOFF);
    const absl::Status lost = moving.Wait(kNever, "Move").status();
    shortest = std::min(shortest, bench.clock().Now() - off);
    ASSERT_TRUE(IsBusOff(lost)) << lost;
    homed = home();
    EXPECT_TRUE(IsBusOff(homed)) << homed;
    Restart();
    // Where it is now nobody knows, also once the driver has connected anew to halt it.
    EXPECT_THAT(ErrorReason(move(10).Wait(kNever, "Move").status()),
                testing::AnyOf("DEVICE_LOST", "NOT_HOMED"));
  }
  std::printf("bus-off was told after %.1f ms\n", Seconds(shortest) * 1e3);
  EXPECT_LT(shortest, kAtOnce);
  const absl::Status homed = home();
  ASSERT_TRUE(homed.ok()) << homed;
  EXPECT_TRUE(move(10).Wait(kNever, "Move").ok());
  EXPECT_NEAR(bench.world().AxisAt(AxisRole::kTurntable, bench.clock().Now()).position.degrees(),
              10, 0.01);
}

TEST(SocketCanVm, BusOffIsToldOfLampsThatAreLitAndTheNextSetConnectsAnew) {
  VmBench bench;
  ASSERT_TRUE(bench.AddNodes(false, true).ok());
  auto lamps = bench.Open(CanopenLampsDriver(), OnInterface(kDigitalLamps), "lamps");
  ASSERT_TRUE(lamps.ok()) << lamps.status();
  auto soon = [&] { return bench.clock().Now() + seconds(60); };
  auto set = [&](const std::vector<float>& levels) {
    Pending<LampsState> done(bench.clock());
    (*lamps)->Set(levels, soon(), done.sink());
    return done.Wait(kNever, "Set").status();
  };
  auto check = [&] {
    Pending<std::monostate> done(bench.clock());
    (*lamps)->Check(soon(), done.sink());
    return done.Wait(kNever, "Check").status();
  };
  auto light = [&] { return bench.world().LampLevels(bench.clock().Now()); };
  const std::vector<float> lit = {1, 1, 1}, one = {0, 1, 0};
  Duration shortest = Duration::max();
  for (int i = 0; i < kTries; ++i) {
    absl::Status done = set(lit);
    ASSERT_TRUE(done.ok()) << done;
    ASSERT_EQ(light(), lit);
    const TimePoint off = bench.clock().Now();
    Report(CAN_ERR_BUSOFF);
    absl::Status lost = check();
    while (lost.ok() && bench.clock().Now() < off + seconds(20)) lost = check();
    shortest = std::min(shortest, bench.clock().Now() - off);
    ASSERT_TRUE(IsBusOff(lost)) << lost;
    done = set(one);
    EXPECT_TRUE(IsBusOff(done)) << done;
    EXPECT_EQ(light(), lit) << "it was not said";
    Restart();
  }
  std::printf("bus-off was told after %.1f ms\n", Seconds(shortest) * 1e3);
  EXPECT_LT(shortest, kAtOnce);
  const absl::Status done = set(one);
  ASSERT_TRUE(done.ok()) << done;
  EXPECT_EQ(light(), one);
}

}  // namespace
}  // namespace lightstage::sim
