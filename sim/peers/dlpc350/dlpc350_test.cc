// The driver dlpc350 against a simulated controller that answers raw reports and lights the simulated rig.
#include <gtest/gtest.h>

#include "drivers/conformance/fixtures.h"
#include "drivers/conformance/unplug.h"
#include "drivers/dlpc350/driver.h"
#include "drivers/dlpc350/link.h"
#include "sim/peers/dlpc350/device.h"
#include "sim/peers/dlpc350/in_process_port.h"
#include "sim/rig/test_rig.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

Pattern Full() {
  Pattern pattern;
  pattern.arrangement = PatternArrangement::kFull;
  return pattern;
}

Pattern Square(PatternProfile profile, int grid, int column, int row) {
  Pattern pattern;
  pattern.arrangement = PatternArrangement::kSquare;
  pattern.profile = profile;
  pattern.grid = grid;
  pattern.column = column;
  pattern.row = row;
  return pattern;
}

Pattern Row() {
  Pattern row = Square(PatternProfile::kGaussian, 16, 1, 5);
  row.arrangement = PatternArrangement::kHorizontal;
  row.influence = 2;
  return row;
}

RigGeometry Geometry() {
  RigGeometry geometry = sim::Rig();
  geometry.projector.width = dlpc350::kMirrorColumns;
  geometry.projector.height = dlpc350::kMirrorRows;
  return geometry;
}

// On its video output is whatever it was told.
class Output final : public Projector {
 public:
  explicit Output(Dlpc350Device& device) : device_(device) {
    info_.width = dlpc350::kMirrorColumns;
    info_.height = dlpc350::kMirrorRows;
  }
  const ProjectorInfo& info() const override { return info_; }
  void Show(const Pattern& pattern, TimePoint, Completion<ProjectorState> done) override {
    if (!fails.ok()) return std::move(done)(fails);
    device_.SetVideoInput(pattern);
    std::move(done)(ProjectorState{pattern});
  }
  void Black(TimePoint deadline, Completion<ProjectorState> done) override {
    Show(Pattern{}, deadline, std::move(done));
  }
  absl::Status fails;

 private:
  Dlpc350Device& device_;
  ProjectorInfo info_;
};

struct Bench {
  explicit Bench(bool flash = true) {
    options.flash = flash;
    options.current = {50, 60, 70};
    options.exposure_us = options.period_us = 8400;
    options.trigger_out1 = {1, 0x10, 0x20};
    options.trigger_out2 = {0, 0xBB};
    options.trigger_in_delay_us = 10.72;
    Place(Full(), {0, 24, 1});
    Place(Square(PatternProfile::kBox, 16, 3, 11), {5, 23, 1});
    Place(Row(), {6, 2, 8});
    Place(Square(PatternProfile::kHat, 4, 3, 3), {6, 1, 8});
    Place(Square(PatternProfile::kBox, 8, 1, 2), {63, 0, 1});
    WorldOptions world_options;
    auto created = World::Create(world_options, geometry, clock);
    EXPECT_TRUE(created.ok()) << created.status();
    world = *created;
    device = std::make_unique<Dlpc350Device>(world, flash_content);
  }
  void Place(const Pattern& pattern, const FlashPlace& place) {
    const auto [image, number, depth] = place;
    options.patterns[pattern] = {image, number, depth, false};
    flash_content[place] = pattern;
  }
  absl::StatusOr<std::unique_ptr<Projector>> Open() {
    const DeviceContext context{"projector", &clock, &geometry};
    std::unique_ptr<Output> screen;
    if (!options.flash) screen = std::make_unique<Output>(*device);
    output = screen.get();
    return OpenLinkedProjector(
        context, "dlpc350",
        std::make_unique<dlpc350::Link>(context, options, InProcessHid(*device, serial),
                                        std::move(screen)));
  }
  absl::Status Show(Projector& projector, const Pattern& pattern) {
    Pending<ProjectorState> done(clock);
    projector.Show(pattern, clock.Now() + seconds(60), done.sink());
    return done.Wait(kNever, "Show").status();
  }
  absl::Status Black(Projector& projector) {
    Pending<ProjectorState> done(clock);
    projector.Black(clock.Now() + seconds(60), done.sink());
    return done.Wait(kNever, "Black").status();
  }

  RealClock clock;
  RigGeometry geometry = Geometry();
  dlpc350::Options options;
  std::string serial = "SIM350";
  std::map<FlashPlace, Pattern> flash_content;
  std::shared_ptr<World> world;
  std::unique_ptr<Dlpc350Device> device;
  Output* output = nullptr;
};

// ---- The contract

class Fixture : public ProjectorFixture {
 public:
  explicit Fixture(bool flash, Duration slow = {}) : bench_(flash) {
    bench_.device->SetSlowness(slow);
  }
  Clock& clock() override { return bench_.clock; }
  absl::StatusOr<std::unique_ptr<Projector>> Open() override { return bench_.Open(); }
  std::optional<Pattern> OnWall() override {
    return std::get<Pattern>(bench_.world->Shown(bench_.clock.Now()));
  }

 private:
  Bench bench_;
};

const bool kFlash =
    RegisterProjectorConformance("Dlpc350Flash", [] { return std::make_unique<Fixture>(true); });
const bool kSlow = RegisterProjectorConformance(
    "Dlpc350FlashSlow", [] { return std::make_unique<Fixture>(true, milliseconds(120)); });
const bool kVideo =
    RegisterProjectorConformance("Dlpc350Video", [] { return std::make_unique<Fixture>(false); });

// ---- What it is set to

TEST(Dlpc350, IsConfiguredAsTheOptionsSay) {
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  const ProjectorInfo& info = (*projector)->info();
  EXPECT_EQ(info.identity.driver, "dlpc350");
  EXPECT_EQ(info.identity.model, "TI DLPC350 firmware 3.1.0");
  EXPECT_EQ(info.identity.serial, "SIM350");
  EXPECT_EQ(info.width, 912);
  EXPECT_EQ(info.height, 1140);
  using Bytes = std::vector<uint8_t>;
  EXPECT_EQ(bench.device->Setting(0x1A1B), Bytes({1})) << "pattern mode";
  EXPECT_EQ(bench.device->Setting(0x1A22), Bytes({3})) << "from flash";
  EXPECT_EQ(bench.device->Setting(0x1A23), Bytes({1}));
  EXPECT_EQ(bench.device->Setting(0x0B01), Bytes({205, 195, 185})) << "inverted";
  EXPECT_EQ(bench.device->Setting(0x1A1D), Bytes({1, 0x10, 0x20}));
  EXPECT_EQ(bench.device->Setting(0x1A1E), Bytes({0, 0xBB}));
  EXPECT_EQ(bench.device->Setting(0x1A35), Bytes({100, 0, 0, 0}));
  EXPECT_EQ(bench.device->Setting(0x1A29), Bytes({0xD0, 0x20, 0, 0, 0xD0, 0x20, 0, 0}));
  EXPECT_EQ(bench.device->LedCurrents(), (std::array<int, 3>{0, 0, 0}));
  ASSERT_TRUE(bench.Show(**projector, Full()).ok());
  EXPECT_EQ(bench.device->LedCurrents(), (std::array<int, 3>{50, 60, 70}));
  ASSERT_TRUE(bench.Black(**projector).ok());
  EXPECT_EQ(bench.device->LedCurrents(), (std::array<int, 3>{0, 0, 0}));
  EXPECT_EQ(bench.device->Setting(0x1A24), Bytes({0})) << "stopped";
}

TEST(Dlpc350, WakesFromStandby) {
  Bench bench;
  // Longer than the wait for one answer.
  bench.device->SetSlowness(dlpc350::Controller::kPatience + milliseconds(300));
  bench.device->PowerCycle(true);
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  EXPECT_EQ(bench.device->woken(), 1);
  EXPECT_TRUE(bench.Show(**projector, Full()).ok());
}

TEST(Dlpc350, ModeStartAndStopMayComeIntoForceLate) {
  Bench bench;
  bench.device->SetSlowness(milliseconds(150));
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  for (const Pattern& pattern : {Full(), Row(), Pattern{}, Full()}) {
    const absl::Status shown = bench.Show(**projector, pattern);
    ASSERT_TRUE(shown.ok()) << shown;
    EXPECT_EQ(bench.device->OnWall(), pattern);
  }
  EXPECT_FALSE(bench.device->enabled_early()) << "nobody knows what it shows then";
  bench.device->SetSlowness(seconds(20));
  const absl::Status late = bench.Show(**projector, Row());
  EXPECT_EQ(ErrorReason(late), "DEVICE_FAULT") << late;
  EXPECT_NE(late.message().find("1A 24 (start and stop of patterns): is 02 after"),
            std::string_view::npos)
      << late;
}

TEST(Dlpc350, APatternThatIsNotStoredIsNamed) {
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  ASSERT_TRUE(bench.Show(**projector, Full()).ok());
  absl::Status shown = bench.Show(**projector, Square(PatternProfile::kBox, 8, 4, 7));
  EXPECT_EQ(ErrorReason(shown), "PATTERN_NOT_STORED") << shown;
  EXPECT_NE(shown.message().find("square-04-07"), std::string_view::npos) << shown;
  EXPECT_EQ(bench.device->OnWall(), Pattern{}) << "nothing else is lit either";
  EXPECT_TRUE(bench.Show(**projector, Full()).ok());
}

TEST(Dlpc350, FieldsThatMakeNoDifferenceDoNotMatter) {
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  Pattern full = Full();
  full.grid = 16;
  EXPECT_TRUE(bench.Show(**projector, full).ok());
}

TEST(Dlpc350, WhatTheValidationFindsIsTold) {
  Bench bench;
  bench.options.exposure_us = bench.options.period_us = 5000;  // too short for 8 bits
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  EXPECT_TRUE(bench.Show(**projector, Full()).ok());
  absl::Status shown = bench.Show(**projector, Row());
  EXPECT_EQ(ErrorReason(shown), "DEVICE_FAULT") << shown;
  EXPECT_NE(shown.message().find("exposure or period is not possible"), std::string_view::npos)
      << shown;
  EXPECT_EQ(bench.device->OnWall(), Pattern{});
}

TEST(Dlpc350, ExternalTriggersAreWaitedForBlack) {
  Bench bench;
  bench.options.trigger_in = 1;
  bench.options.period_us = bench.options.exposure_us + 230;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  ASSERT_TRUE(bench.Show(**projector, Row()).ok());
  EXPECT_EQ(bench.device->OnWall(), Pattern{});
  bench.device->TriggerIn();
  EXPECT_EQ(bench.device->OnWall(), Row());
}

TEST(Dlpc350, ARigWithOtherPixelsIsRefused) {
  Bench bench;
  bench.geometry.projector.width = 1280;
  absl::Status opened = bench.Open().status();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE") << opened;
  EXPECT_NE(opened.message().find("912x1140"), std::string_view::npos) << opened;
  EXPECT_NE(opened.message().find("1280x1140"), std::string_view::npos) << opened;
}

// ---- Faults

struct NamedFault {
  const char* name;
  Dlpc350Device::Faults faults;
  const char* reason;
  const char* told;
};

class Dlpc350Fault : public testing::TestWithParam<NamedFault> {};

TEST_P(Dlpc350Fault, IsFoundAndNamedAndGoesAway) {
  const NamedFault& fault = GetParam();
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  ASSERT_TRUE(bench.Show(**projector, Full()).ok());
  bench.device->SetFaults(fault.faults);
  absl::Status shown = bench.Show(**projector, Row());
  EXPECT_EQ(ErrorReason(shown), fault.reason) << shown;
  EXPECT_NE(shown.message().find(fault.told), std::string_view::npos) << shown;
  EXPECT_NE(shown.message().find("projector: "), std::string_view::npos) << shown;
  EXPECT_NE(bench.device->OnWall(), Row()) << "light that was not confirmed";
  bench.device->SetFaults({});
  EXPECT_TRUE(bench.Show(**projector, Row()).ok());
  EXPECT_EQ(bench.device->OnWall(), Row());
}

TEST_P(Dlpc350Fault, IsFoundWhenItIsOpened) {
  const NamedFault& fault = GetParam();
  Bench bench;
  bench.device->SetFaults(fault.faults);
  auto projector = bench.Open();
  // Some show only when something is to be lit.
  absl::Status status = projector.ok() ? bench.Show(**projector, Row()) : projector.status();
  EXPECT_EQ(ErrorReason(status), fault.reason) << status;
  EXPECT_NE(status.message().find(fault.told), std::string_view::npos) << status;
}

INSTANTIATE_TEST_SUITE_P(
    All, Dlpc350Fault,
    testing::Values(
        NamedFault{"NackOfStart",
                   {.nack = 0x1A24},
                   "DEVICE_FAULT",
                   "1A 24 (start and stop of patterns): refused (nack)"},
        NamedFault{
            "NackOfMailbox", {.nack = 0x1A34}, "DEVICE_FAULT", "1A 34 (mailbox data): refused"},
        NamedFault{
            "NackOfStatus", {.nack = 0x1A0C}, "DEVICE_FAULT", "1A 0C (main status): refused"},
        NamedFault{"LedsStuck",
                   {.ignored = 0x1A07},
                   "DEVICE_FAULT",
                   "1A 07 (LED enable): is 08 after it was set to 00"},
        NamedFault{
            "LutNotTaken", {.ignored = 0x1A34}, "DEVICE_FAULT", "1A 34 (mailbox data): mailbox"},
        NamedFault{"ShortReport",
                   {.short_reports = true},
                   "DEVICE_FAULT",
                   "a report of 5 bytes instead of 64"},
        NamedFault{"Parked", {.parked = true}, "DEVICE_FAULT", "the mirrors are parked"},
        NamedFault{"SequencerStopped",
                   {.sequencer_stopped = true},
                   "DEVICE_FAULT",
                   "the sequencer stands still"},
        NamedFault{"SequencerError", {.hardware_errors = 0x80}, "DEVICE_FAULT", "sequencer error"},
        NamedFault{"Silent", {.silent = true}, "DEVICE_SILENT", "was not answered"}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(Dlpc350, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  bool full = false;
  CheckUnplugging(bench.clock, "projector",
                  {.plug =
                       [&](bool plugged) {
                         if (plugged) bench.device->PowerCycle(false);
                         bench.device->Unplug(!plugged);
                       },
                   .use = [&] { return bench.Show(**projector, (full = !full) ? Full() : Row()); },
                   .recover = [&] { return bench.Show(**projector, Pattern{}); }});
}

TEST(Dlpc350, UnpluggedIsLostAndComesBack) {
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  ASSERT_TRUE(bench.Show(**projector, Full()).ok());
  bench.device->Unplug(true);
  absl::Status shown = bench.Show(**projector, Row());
  EXPECT_EQ(ErrorReason(shown), "DEVICE_LOST") << shown;
  EXPECT_EQ(shown.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(ErrorReason(bench.Show(**projector, Row())), "DEVICE_NOT_FOUND");
  bench.device->PowerCycle(false);
  bench.device->Unplug(false);
  EXPECT_TRUE(bench.Show(**projector, Row()).ok()) << "connected and configured anew";
  EXPECT_EQ(bench.device->OnWall(), Row());
}

// Its USB stays, its settings do not: it shows its video input as if nothing were.
TEST(Dlpc350, AResetInAnExposureIsToldAndMended) {
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  const auto check = [&] {
    Pending<std::monostate> done(bench.clock);
    (*projector)->Check(bench.clock.Now() + seconds(60), done.sink());
    return done.Wait(kNever, "Check").status();
  };
  ASSERT_TRUE(bench.Show(**projector, Row()).ok());
  EXPECT_TRUE(check().ok());
  bench.device->PowerCycle(false);
  EXPECT_EQ(ErrorReason(check()), "DEVICE_LOST");
  EXPECT_TRUE(bench.Show(**projector, Row()).ok()) << "configured anew";
  EXPECT_EQ(bench.device->OnWall(), Row());
  EXPECT_TRUE(check().ok());
  bench.device->PowerCycle(false);
  EXPECT_TRUE(bench.Show(**projector, Full()).ok()) << "found before it is used";
  EXPECT_EQ(bench.device->OnWall(), Full());
}

TEST(Dlpc350, UnpluggedWhileItIsWaitedFor) {
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  bench.device->SetFaults({.silent = true});
  Pending<ProjectorState> done(bench.clock);
  (*projector)->Show(Row(), bench.clock.Now() + seconds(60), done.sink());
  SleepFor(bench.clock, milliseconds(50));
  bench.device->Unplug(true);
  EXPECT_EQ(ErrorReason(done.Wait(kNever, "Show").status()), "DEVICE_LOST");
}

TEST(Dlpc350, AnotherOneInItsPlaceIsNotTaken) {
  Bench bench;
  std::string serial = "FIRST";
  const DeviceContext context{"projector", &bench.clock, &bench.geometry};
  auto open = [&] { return InProcessHid(*bench.device, serial)(); };
  auto projector = OpenLinkedProjector(
      context, "dlpc350", std::make_unique<dlpc350::Link>(context, bench.options, open, nullptr));
  ASSERT_TRUE(projector.ok()) << projector.status();
  bench.device->Unplug(true);
  EXPECT_EQ(ErrorReason(bench.Show(**projector, Full())), "DEVICE_LOST");
  serial = "SECOND";
  bench.device->Unplug(false);
  absl::Status shown = bench.Show(**projector, Full());
  EXPECT_EQ(ErrorReason(shown), "DEVICE_UNSUITABLE") << shown;
  EXPECT_NE(shown.message().find("SECOND"), std::string_view::npos) << shown;
}

// Answers that come when nobody waits for them any more are not taken for those to the next command.
TEST(Dlpc350, LateAnswersAreNotMistaken) {
  Bench bench;
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  bench.device->SetFaults({.late = true});
  EXPECT_EQ(ErrorReason(bench.Show(**projector, Row())), "DEVICE_SILENT");
  bench.device->SetFaults({});
  EXPECT_TRUE(bench.Show(**projector, Row()).ok());
  EXPECT_EQ(bench.device->OnWall(), Row());
}

// ---- Video

TEST(Dlpc350Video, NeedsAPictureThatMovesOnAndAnOutputThatWorks) {
  Bench bench(false);
  auto projector = bench.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  bench.device->SetFaults({.frozen = true});
  absl::Status shown = bench.Show(**projector, Row());
  EXPECT_EQ(ErrorReason(shown), "DEVICE_FAULT") << shown;
  EXPECT_NE(shown.message().find("frozen"), std::string_view::npos) << shown;
  EXPECT_EQ(bench.device->OnWall(), Pattern{});
  bench.device->SetFaults({});
  for (const char* reason : {"DISPLAY_CHANGED", "DEVICE_SILENT", "DEVICE_LOST"}) {
    bench.output->fails = absl::OkStatus();
    EXPECT_TRUE(bench.Show(**projector, Row()).ok());
    EXPECT_EQ(bench.device->OnWall(), Row());
    bench.output->fails = Error(absl::StatusCode::kFailedPrecondition, reason, "as said");
    EXPECT_EQ(ErrorReason(bench.Show(**projector, Full())), reason);
    EXPECT_EQ(bench.device->OnWall(), Pattern{}) << reason;
    EXPECT_EQ(bench.device->LedCurrents(), (std::array<int, 3>{0, 0, 0})) << reason;
  }
}

// The driver as a rig file opens it, as far as this machine goes.
absl::Status Parse(const Driver<Projector>& driver, const std::string& text) {
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse("[projector]\n" + text, "rig.toml");
  if (!document.ok()) return document.status();
  driver.parse(document->root().Table("projector"));
  return document->Finish();
}

TEST(Dlpc350Driver, HandsTheSubTableToTheOutputsDriver) {
  const std::string video =
      "mode = \"video\"\nled_current = [9, 9, 9]\nled_current_limit = 9\n"
      "[projector.display]\noutput = \"HDMI-1\"\n";
  Driver<Projector> screen;
  std::string output;
  screen.parse = [&output](const TomlTable& table) -> DeviceOpener<Projector> {
    output = table.String("output");
    return [](const DeviceContext&) -> absl::StatusOr<std::unique_ptr<Projector>> {
      return absl::UnavailableError("there is none");
    };
  };
  EXPECT_TRUE(Parse(Dlpc350Driver(std::move(screen)), video).ok());
  EXPECT_EQ(output, "HDMI-1");
  absl::Status alone = Parse(Dlpc350Driver(), video);
  EXPECT_NE(alone.message().find("mode: \"video\" needs a driver"), std::string_view::npos)
      << alone;
}

TEST(Dlpc350Discovery, FindsNoneOnAMachineWithout) {
  auto found = Dlpc350Discovery()();
  EXPECT_TRUE(found.ok()) << found.status();
}

}  // namespace
}  // namespace lightstage::sim
