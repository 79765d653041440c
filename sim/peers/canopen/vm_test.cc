// The same over the kernel's CAN: for a machine that has it, e.g. a virtual one with vcan or two coupled kvaser_pci cards. Not among the usual
// tests: build the target vm_test_canopen and set
//
//   LIGHTSTAGE_CAN_INTERFACE       the driver's interface, up
//   LIGHTSTAGE_CAN_PEER_INTERFACE  the simulated nodes' on the same wire; not set: the same interface (vcan)
//
// Needs the right to set the interface down and up.
#include <gmock/gmock.h>

#include <cstdlib>

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

}  // namespace
}  // namespace lightstage::sim
