// The dmx driver over both simulated widgets: what it says is lit, is lit in the simulated world; and every fault is told.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <thread>

#include "drivers/conformance/fixtures.h"
#include "drivers/conformance/unplug.h"
#include "drivers/dmx/dmx_lamps.h"
#include "sim/peers/dmx/dmx_pro.h"
#include "sim/peers/dmx/open_dmx.h"
#include "sim/rig/test_rig.h"

namespace lightstage::sim {
namespace {

using dmx::DmxOptions;
using dmx::WidgetKind;
using std::chrono::milliseconds;
using std::chrono::seconds;

// A widget with the three lamps of the test rig, and what the driver is told about it.
class Desk {
 public:
  explicit Desk(WidgetKind kind, int bits = 8, int slots = 512) {
    absl::StatusOr<std::shared_ptr<World>> world = World::Create({}, Rig(), clock_);
    EXPECT_TRUE(world.ok()) << world.status();
    world_ = *world;
    options_.widget = kind;
    options_.channels = {.first = {1, 5, slots - 1}, .bits = bits, .slots = slots};
    options_.device.serial = "LAMPS01";
    const DmxFixtureOptions fixtures = {
        .first_channels = options_.channels.first, .fine = bits == 16, .slots = slots};
    if (kind == WidgetKind::kOpen) {
      device_ = open_ = std::make_shared<OpenDmx>(
          dmx::UsbIdentity{"1-2", "FTDI", "FT232R USB UART", "LAMPS01", ""}, clock_, fixtures,
          world_);
    } else {
      device_ = pro_ =
          std::make_shared<DmxPro>(dmx::UsbIdentity{"1-2", "ENTTEC", "DMX USB PRO", "LAMPS01", ""},
                                   clock_, DmxProOptions{.chatty = true}, fixtures, world_);
    }
    // Somebody else's, which must not be touched.
    other_ = std::make_shared<OpenDmx>(
        dmx::UsbIdentity{"1-3", "FTDI", "FT232R USB UART", "OTHER", ""}, clock_, fixtures, world_);
  }

  std::unique_ptr<dmx::UsbBus> Bus() { return MakeSimUsbBus({other_, device_}); }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() {
    return dmx::OpenDmxLamps(options_, {"lamps", &clock_, nullptr}, Bus());
  }
  std::vector<float> Lit() {
    device_->Advance();
    return world_->LampLevels(clock_.Now());
  }

  Clock& clock() { return clock_; }
  DmxOptions& options() { return options_; }
  SimUsbDevice& device() { return *device_; }
  OpenDmx* open() { return open_.get(); }
  DmxPro* pro() { return pro_.get(); }
  SimUsbDevice& other() { return *other_; }

 private:
  RealClock clock_;  // first: the devices' timers are on it
  std::shared_ptr<World> world_;
  DmxOptions options_;
  std::shared_ptr<OpenDmx> open_, other_;
  std::shared_ptr<DmxPro> pro_;
  std::shared_ptr<SimUsbDevice> device_;
};

// ---- Conformance

class DmxFixture : public LampsFixture {
 public:
  DmxFixture(WidgetKind kind, int bits) : desk_(kind, bits) {}
  Clock& clock() override { return desk_.clock(); }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() override {
    desk_.options().settle = milliseconds(1);
    return desk_.Open();
  }
  std::optional<std::vector<float>> Emitted() override { return desk_.Lit(); }

 private:
  Desk desk_;
};

[[maybe_unused]] const bool kOpen = RegisterLampsConformance(
    "OpenDmx", [] { return std::make_unique<DmxFixture>(WidgetKind::kOpen, 8); });
[[maybe_unused]] const bool kOpenFine = RegisterLampsConformance(
    "OpenDmx16", [] { return std::make_unique<DmxFixture>(WidgetKind::kOpen, 16); });
[[maybe_unused]] const bool kPro = RegisterLampsConformance(
    "DmxPro", [] { return std::make_unique<DmxFixture>(WidgetKind::kPro, 8); });
[[maybe_unused]] const bool kProFine = RegisterLampsConformance(
    "DmxPro16", [] { return std::make_unique<DmxFixture>(WidgetKind::kPro, 16); });

// ---- What only these have

const std::vector<float> kAll = {1, 1, 1}, kNone = {0, 0, 0}, kSome = {1, 0, 1};

class DmxTest : public testing::TestWithParam<WidgetKind> {
 protected:
  DmxTest() : desk_(GetParam()) {}

  void OpenLamps() {
    absl::StatusOr<std::unique_ptr<Lamps>> lamps = desk_.Open();
    ASSERT_TRUE(lamps.ok()) << lamps.status();
    lamps_ = *std::move(lamps);
  }
  TimePoint Soon() { return desk_.clock().Now() + seconds(60); }
  absl::Status Set(const std::vector<float>& levels) {
    Pending<LampsState> done(desk_.clock());
    lamps_->Set(levels, Soon(), done.sink());
    return done.Wait(kNever, "Set").status();
  }
  absl::Status Dark() {
    Pending<LampsState> done(desk_.clock());
    lamps_->Dark(Soon(), done.sink());
    return done.Wait(kNever, "Dark").status();
  }
  // Until the widget is given back.
  bool HandleClosed() {
    return desk_.clock().WaitUntil(Soon(), [&] {
      std::this_thread::sleep_for(milliseconds(1));
      return desk_.device().handles() == 0;
    });
  }

  Desk desk_;
  std::unique_ptr<Lamps> lamps_;
};

INSTANTIATE_TEST_SUITE_P(Widgets, DmxTest, testing::Values(WidgetKind::kOpen, WidgetKind::kPro),
                         [](const auto& info) {
                           return info.param == WidgetKind::kOpen ? "Open" : "Pro";
                         });

TEST_P(DmxTest, TellsWhatItIs) {
  OpenLamps();
  const LampsInfo& info = lamps_->info();
  EXPECT_EQ(info.identity.driver, "dmx");
  EXPECT_EQ(info.identity.serial, "LAMPS01");
  EXPECT_EQ(info.count, 3);
  EXPECT_EQ(info.steps, 255);
  EXPECT_EQ(info.max_time_to_dark, Duration::zero());
  if (desk_.pro() != nullptr) {
    EXPECT_NE(info.identity.model.find("00396804"), std::string::npos) << info.identity.model;
    EXPECT_NE(info.identity.model.find("firmware 1.44"), std::string::npos) << info.identity.model;
  }
  EXPECT_EQ(desk_.other().opened(), 0);
}

TEST_P(DmxTest, LeavesDarkAndGivesTheDeviceBack) {
  OpenLamps();
  ASSERT_TRUE(Set(kAll).ok());
  EXPECT_EQ(desk_.Lit(), kAll);
  EXPECT_EQ(desk_.device().handles(), 1);
  lamps_.reset();
  EXPECT_EQ(desk_.Lit(), kNone);
  EXPECT_EQ(desk_.device().handles(), 0);
  // A Pro is not asked to stop: fixtures that hold the last levels would not notice, others would lose their signal.
  if (desk_.pro() != nullptr) {
    EXPECT_TRUE(desk_.pro()->sending());
  }
}

// The receiver checks rate, format, break, mark, start code and length of every frame.
TEST(OpenDmxLine, EveryFrameIsWhole) {
  for (int slots : {24, 100, 512}) {
    Desk desk(WidgetKind::kOpen, 8, slots);
    absl::StatusOr<std::unique_ptr<Lamps>> lamps = desk.Open();
    ASSERT_TRUE(lamps.ok()) << lamps.status();
    const TimePoint give_up = desk.clock().Now() + seconds(60);
    while (desk.open()->whole_frames() < 10 && desk.clock().Now() < give_up) {
      SleepFor(desk.clock(), milliseconds(5));
    }
    EXPECT_GE(desk.open()->whole_frames(), 10) << "frames go on by themselves";
    lamps->reset();
    EXPECT_THAT(desk.open()->refusals(), testing::IsEmpty()) << slots;
  }
}

// Levels change from one whole frame to the next, while frames go out all the time.
TEST_P(DmxTest, ManySetsAreEachConfirmed) {
  OpenLamps();
  for (int i = 0; i < 20; ++i) {
    const std::vector<float> levels = {i % 2 ? 1.0f : 0.0f, i % 3 ? 1.0f : 0.0f, 1.0f};
    ASSERT_TRUE(Set(levels).ok()) << i;
    EXPECT_EQ(desk_.Lit(), levels) << i;
  }
}

// ---- Faults

TEST_P(DmxTest, UnpluggedMidFrameIsLostAndComesBack) {
  OpenLamps();
  ASSERT_TRUE(Set(kAll).ok());
  desk_.device().Fail(UsbFault::kUnplugMidFrame);
  const TimePoint begin = desk_.clock().Now();
  const absl::Status lost = Set(kSome);
  EXPECT_EQ(lost.code(), absl::StatusCode::kUnavailable) << lost;
  EXPECT_EQ(ErrorReason(lost), "DEVICE_LOST") << lost;
  EXPECT_LT(desk_.clock().Now() - begin, seconds(10)) << "it does not hang";
  EXPECT_TRUE(HandleClosed());
  EXPECT_EQ(desk_.Lit(), kAll) << "half a frame lights nothing";

  const absl::Status still = Set(kSome);
  EXPECT_EQ(ErrorReason(still), "DEVICE_LOST") << still;
  EXPECT_EQ(ErrorReason(Dark()), "DEVICE_LOST");

  desk_.device().Fail(UsbFault::kNone);
  desk_.device().Plug();
  const absl::Status back = Set(kSome);
  EXPECT_TRUE(back.ok()) << back;
  EXPECT_EQ(desk_.Lit(), kSome);
  EXPECT_EQ(desk_.device().handles(), 1);
}

TEST_P(DmxTest, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  OpenLamps();
  bool all = false;
  CheckUnplugging(
      desk_.clock(), "lamps",
      {.plug = [&](bool plugged) { plugged ? desk_.device().Plug() : desk_.device().Unplug(); },
       .use = [&] { return Set((all = !all) ? kAll : kSome); },
       .recover = [&] { return Dark(); }});
  EXPECT_EQ(desk_.device().handles(), 1);
}

TEST_P(DmxTest, AfterALossDarkConnectsAnew) {
  OpenLamps();
  ASSERT_TRUE(Set(kAll).ok());
  desk_.device().Unplug();
  EXPECT_EQ(ErrorReason(Set(kSome)), "DEVICE_LOST");
  desk_.device().Plug();
  EXPECT_TRUE(Dark().ok());
  EXPECT_EQ(desk_.Lit(), kNone);
}

// Out and in again between two operations: nobody knows what the lamps did, so that the next one must fail, whichever it is. But dark
// they are.
TEST_P(DmxTest, ALossBetweenOperationsIsNotHidden) {
  OpenLamps();
  for (bool dark : {false, true}) {
    ASSERT_TRUE(Set(kAll).ok());
    desk_.device().Unplug();
    desk_.device().Plug();
    SleepFor(desk_.clock(), milliseconds(100));
    if (dark) {
      EXPECT_TRUE(Dark().ok()) << "whatever was lost, it is dark now";
      EXPECT_EQ(desk_.Lit(), kNone);
    } else {
      const absl::Status next = Set(kSome);
      EXPECT_EQ(ErrorReason(next), "DEVICE_LOST") << next;
    }
    EXPECT_TRUE(Set(kSome).ok());
  }
}

TEST_P(DmxTest, AStallIsSilence) {
  OpenLamps();
  ASSERT_TRUE(Set(kAll).ok());
  desk_.device().Fail(UsbFault::kStall);
  const absl::Status stalled = Set(kSome);
  EXPECT_EQ(stalled.code(), absl::StatusCode::kDeadlineExceeded) << stalled;
  EXPECT_EQ(ErrorReason(stalled), "DEVICE_SILENT") << stalled;
  EXPECT_TRUE(HandleClosed());
  desk_.device().Fail(UsbFault::kNone);
  const absl::Status back = Set(kSome);
  EXPECT_TRUE(back.ok()) << back;
  EXPECT_EQ(desk_.Lit(), kSome);
}

TEST_P(DmxTest, AShortWriteIsNoConfirmation) {
  OpenLamps();
  ASSERT_TRUE(Set(kAll).ok());
  desk_.device().Fail(UsbFault::kShortWrite);
  const absl::Status half = Set(kNone);
  EXPECT_EQ(ErrorReason(half), "DEVICE_SILENT") << half;
  EXPECT_NE(half.message().find(" took "), std::string_view::npos) << half;
  EXPECT_TRUE(HandleClosed());
  EXPECT_EQ(desk_.Lit(), kAll);
  desk_.device().Fail(UsbFault::kNone);
  EXPECT_TRUE(Set(kNone).ok());
  EXPECT_EQ(desk_.Lit(), kNone);
}

TEST_P(DmxTest, SilenceIsNoConfirmation) {
  OpenLamps();
  ASSERT_TRUE(Set(kAll).ok());
  desk_.device().Fail(UsbFault::kSilent);
  const absl::Status silent = Set(kNone);
  EXPECT_EQ(ErrorReason(silent), "DEVICE_SILENT") << silent;
  EXPECT_EQ(desk_.Lit(), kAll);
  desk_.device().Fail(UsbFault::kNone);
  EXPECT_TRUE(Dark().ok());
  EXPECT_EQ(desk_.Lit(), kNone);
}

TEST(OpenDmxFaults, BytesThatDoNotLeaveTheChipAreNoConfirmation) {
  Desk desk(WidgetKind::kOpen);
  absl::StatusOr<std::unique_ptr<Lamps>> lamps = desk.Open();
  ASSERT_TRUE(lamps.ok()) << lamps.status();
  desk.device().Fail(UsbFault::kNeverEmpty);
  Pending<LampsState> done(desk.clock());
  (*lamps)->Set(kAll, desk.clock().Now() + seconds(60), done.sink());
  const absl::Status held = done.Wait(kNever, "Set").status();
  EXPECT_EQ(ErrorReason(held), "DEVICE_SILENT") << held;
  EXPECT_NE(held.message().find("still holds"), std::string_view::npos) << held;
}

TEST_P(DmxTest, OpeningTellsWhatIsWrong) {
  desk_.device().Fail(UsbFault::kSilent);
  absl::Status silent = desk_.Open().status();
  EXPECT_EQ(ErrorReason(silent), "DEVICE_SILENT") << silent;
  EXPECT_NE(silent.message().find("lamps"), std::string_view::npos) << silent;
  EXPECT_EQ(desk_.device().handles(), 0);

  desk_.device().Fail(UsbFault::kNone);
  desk_.device().Unplug();
  absl::Status absent = desk_.Open().status();
  EXPECT_EQ(ErrorReason(absent), "DEVICE_LOST") << absent;
  EXPECT_NE(absent.message().find("OTHER"), std::string_view::npos)
      << "says what there is: " << absent;

  desk_.device().Plug();
  absl::StatusOr<std::unique_ptr<dmx::UsbPort>> somebody = desk_.device().Open();
  ASSERT_TRUE(somebody.ok());
  EXPECT_EQ(ErrorReason(desk_.Open().status()), "DEVICE_BUSY");
  somebody->reset();

  desk_.options().widget = GetParam() == WidgetKind::kOpen ? WidgetKind::kPro : WidgetKind::kOpen;
  absl::Status other_kind = desk_.Open().status();
  EXPECT_FALSE(other_kind.ok());
  EXPECT_NE(other_kind.message().find("DMX USB P"), std::string_view::npos) << other_kind;
  EXPECT_EQ(desk_.device().handles(), 0);
}

// ---- The link, without the contract around it

// A stopped frame thread must never look like lit lamps.
TEST_P(DmxTest, CheckTellsThatFramesHaveStopped) {
  std::unique_ptr<LampsLink> link =
      dmx::MakeDmxLink(desk_.options(), {"lamps", &desk_.clock(), nullptr}, desk_.Bus());
  ASSERT_TRUE(link->Connect().ok());
  ASSERT_TRUE(link->Set(kAll).ok());
  EXPECT_TRUE(link->Check().ok());
  desk_.device().Unplug();
  absl::Status checked;
  EXPECT_TRUE(desk_.clock().WaitUntil(Soon(), [&] {
    std::this_thread::sleep_for(milliseconds(5));
    checked = link->Check();
    return !checked.ok();
  }));
  EXPECT_EQ(ErrorReason(checked), "DEVICE_LOST") << checked;
  desk_.device().Plug();
  ASSERT_TRUE(link->Set(kAll).ok());
  EXPECT_TRUE(link->Check().ok());
  EXPECT_EQ(desk_.Lit(), kAll);
}

// By address alone, another widget in its place is not taken.
TEST(DmxProFaults, AnotherWidgetInItsPlaceIsRefused) {
  RealClock clock;
  absl::StatusOr<std::shared_ptr<World>> world = World::Create({}, Rig(), clock);
  ASSERT_TRUE(world.ok());
  const DmxFixtureOptions fixtures = {.first_channels = {1, 2, 3}};
  // One that has no serial number on the USB: the widget's own counts.
  auto widget = std::make_shared<DmxPro>(dmx::UsbIdentity{"1-2", "ENTTEC", "DMX USB PRO", "", ""},
                                         clock, DmxProOptions{}, fixtures, *world);
  DmxOptions options{.widget = WidgetKind::kPro};
  options.device.address = "1-2";
  options.channels.first = {1, 2, 3};
  std::unique_ptr<LampsLink> link =
      dmx::MakeDmxLink(options, {"lamps", &clock, nullptr}, MakeSimUsbBus({widget}));
  ASSERT_TRUE(link->Connect().ok());
  EXPECT_EQ(link->info().identity.serial, "00396804");
  widget->SetSerial(0x12345678);
  const absl::Status another = link->Connect();
  EXPECT_EQ(ErrorReason(another), "DEVICE_UNSUITABLE") << another;
  EXPECT_NE(another.message().find("12345678"), std::string_view::npos) << another;
  EXPECT_EQ(widget->handles(), 0);
}

// What a program that dies leaves on the line: README.md of the driver.
TEST_P(DmxTest, WithoutTheDaemonAnOpenDmxIsSilentAndAProGoesOn) {
  std::unique_ptr<LampsLink> link =
      dmx::MakeDmxLink(desk_.options(), {"lamps", &desk_.clock(), nullptr}, desk_.Bus());
  ASSERT_TRUE(link->Connect().ok());
  ASSERT_TRUE(link->Set(kAll).ok());
  link.reset();
  EXPECT_EQ(desk_.device().handles(), 0);
  if (desk_.pro() != nullptr) {
    EXPECT_TRUE(desk_.pro()->sending());
    return;
  }
  const int frames = desk_.open()->whole_frames();
  SleepFor(desk_.clock(), milliseconds(200));
  EXPECT_EQ(desk_.open()->whole_frames(), frames);
}

// ---- The receiver's own doubts, without the driver

class Receiver : public testing::Test {
 protected:
  Receiver() {
    world_ = *World::Create({}, Rig(), clock_);
    device_ = std::make_shared<OpenDmx>(dmx::UsbIdentity{"1-2", "", "", "", ""}, clock_,
                                        DmxFixtureOptions{.first_channels = {1, 2, 3}, .slots = 24},
                                        world_);
    port_ = *device_->Open();
  }
  void Request(int request, int value, int index = 0) {
    const dmx::UsbRequest asked = {0x40, static_cast<uint8_t>(request),
                                   static_cast<uint16_t>(value), static_cast<uint16_t>(index)};
    ASSERT_TRUE(port_->Control(asked, seconds(1)).ok());
  }
  void Frame(size_t bytes = 25, uint8_t start_code = 0) {
    Request(4, 0x5008);
    SleepFor(clock_, milliseconds(1));
    Request(4, 0x1008);
    SleepFor(clock_, milliseconds(1));
    std::vector<uint8_t> frame(bytes, 255);
    frame[0] = start_code;
    ASSERT_TRUE(port_->BulkOut(frame, seconds(1)).ok());
    SleepFor(clock_, milliseconds(30));
    device_->Advance();
  }
  bool Refused(const std::string& why) {
    for (const std::string& refusal : device_->refusals()) {
      if (refusal.find(why) != std::string::npos) return device_->whole_frames() == 0;
    }
    return false;
  }

  RealClock clock_;
  std::shared_ptr<World> world_;
  std::shared_ptr<OpenDmx> device_;
  std::unique_ptr<dmx::UsbPort> port_;
};

TEST_F(Receiver, BelievesAGoodFrame) {
  Request(3, 12);
  Frame();
  EXPECT_EQ(device_->whole_frames(), 1);
  EXPECT_EQ(world_->LampLevels(clock_.Now()), kAll);
}

TEST_F(Receiver, DoubtsAWrongRate) {
  Request(3, 13);
  Frame();
  EXPECT_TRUE(Refused("baud"));
}

TEST_F(Receiver, DoubtsOneStopBit) {
  Request(3, 12);
  Request(4, 0x4008);
  SleepFor(clock_, milliseconds(1));
  Request(4, 0x0008);
  SleepFor(clock_, milliseconds(1));
  ASSERT_TRUE(port_->BulkOut(std::vector<uint8_t>(25), seconds(1)).ok());
  SleepFor(clock_, milliseconds(30));
  EXPECT_TRUE(Refused("8N2"));
}

TEST_F(Receiver, DoubtsADriverThatIsOff) {
  Request(3, 12);
  Request(1, 0x0202);
  Frame();
  EXPECT_TRUE(Refused("RTS"));
}

TEST_F(Receiver, DoubtsWhatHasNoBreak) {
  Request(3, 12);
  ASSERT_TRUE(port_->BulkOut(std::vector<uint8_t>(25), seconds(1)).ok());
  SleepFor(clock_, milliseconds(30));
  EXPECT_EQ(device_->whole_frames(), 0);
}

TEST_F(Receiver, DoubtsAnotherStartCode) {
  Request(3, 12);
  Frame(25, 0xCC);
  EXPECT_TRUE(Refused("start code 204"));
}

TEST_F(Receiver, DoubtsAShortFrame) {
  Request(3, 12);
  Frame(24);
  Request(4, 0x5008);
  EXPECT_TRUE(Refused("a frame of 23 slots"));
}

TEST_F(Receiver, DoubtsABreakIntoAFrame) {
  Request(3, 12);
  Request(4, 0x5008);
  SleepFor(clock_, milliseconds(1));
  Request(4, 0x1008);
  SleepFor(clock_, milliseconds(1));
  ASSERT_TRUE(port_->BulkOut(std::vector<uint8_t>(125), seconds(1)).ok());  // 5.5 ms
  Request(4, 0x5008);
  // On a machine that was too busy meanwhile the frame was over.
  EXPECT_TRUE(Refused("on their way") || device_->whole_frames() == 1);
}

}  // namespace
}  // namespace lightstage::sim
