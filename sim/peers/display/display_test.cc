// drivers/display on an X server in memory: what is really on the screen is read past all of X.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "drivers/conformance/fixtures.h"
#include "drivers/conformance/unplug.h"
#include "drivers/display/driver.h"
#include "drivers/display/raster.h"
#include "drivers/display/screen.h"
#include "sim/peers/display/x_intruder.h"
#include "sim/peers/display/xvfb_process.h"
#include "sim/peers/display/xwd.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kWidth = 320, kHeight = 200;

RigGeometry Geometry(int width, int height) {
  RigGeometry geometry;
  geometry.projector.present = true;
  geometry.projector.width = width;
  geometry.projector.height = height;
  return geometry;
}

// One that no other test takes, also when its server has ended.
std::string OwnDisplay() {
  static int made = 0;
  return absl::StrCat(":", 1000 + (getpid() * 8 + made++ % 8) % 50000);
}

struct Rig {
  explicit Rig(std::string options = "renderer = \"software\"\n", int width = kWidth,
               int height = kHeight, bool cursor = false)
      : geometry(Geometry(width, height)), keys(std::move(options)) {
    absl::StatusOr<XvfbProcess> started =
        XvfbProcess::Start({kWidth, kHeight, cursor, OwnDisplay()});
    EXPECT_TRUE(started.ok()) << started.status();
    if (started.ok()) xvfb.emplace(*std::move(started));
  }

  absl::StatusOr<std::unique_ptr<Projector>> Open() {
    ASSIGN_OR_RETURN(
        TomlDocument document,
        TomlDocument::Parse(absl::StrCat("[projector]\noutput_index = 0\nx_display = \"",
                                         xvfb->display(), "\"\n", keys),
                            "rig.toml"));
    DeviceOpener<Projector> open = DisplayDriver().parse(document.root().Table("projector"));
    RETURN_IF_ERROR(document.Finish());
    return open({"projector", &clock, &geometry});
  }

  absl::Status Show(Projector& projector, const Pattern& pattern) {
    Pending<ProjectorState> done(clock);
    projector.Show(pattern, clock.Now() + seconds(60), done.sink());
    return done.Wait(kNever, "Show").status();
  }

  // The first pixel that is not the pattern's.
  std::string Difference(const Pattern& pattern, double gamma = 1) {
    absl::StatusOr<XwdPicture> picture = ParseXwd(xvfb->screen());
    if (!picture.ok()) return MessageOf(picture.status());
    const std::vector<uint8_t> codes = RasterOf(pattern, kWidth, kHeight, gamma);
    if (picture->width != kWidth || picture->height != kHeight) return "another size";
    for (size_t i = 0; i < codes.size(); ++i) {
      if (picture->pixels[i] != codes[i] * 0x010101u) {
        return absl::StrCat("pixel ", i % kWidth, ",", i / kWidth, " is ",
                            absl::Hex(picture->pixels[i]), " instead of ", codes[i]);
      }
    }
    return "";
  }

  RealClock clock;
  RigGeometry geometry;
  std::string keys;
  std::optional<XvfbProcess> xvfb;
};

Pattern Full() {
  Pattern pattern;
  pattern.arrangement = PatternArrangement::kFull;
  return pattern;
}

Pattern Hat() {
  Pattern pattern;
  pattern.arrangement = PatternArrangement::kSquare;
  pattern.profile = PatternProfile::kHat;
  pattern.grid = 4;
  pattern.column = 1;
  pattern.row = 2;
  return pattern;
}

// ---- The contract. The patterns of the suite are told apart by their pixels.

class DisplayFixture : public ProjectorFixture {
 public:
  explicit DisplayFixture(std::string keys) : rig_(std::move(keys)) {}
  Clock& clock() override { return rig_.clock; }
  absl::StatusOr<std::unique_ptr<Projector>> Open() override { return rig_.Open(); }
  std::optional<Pattern> OnWall() override {
    Pattern row = Hat();
    row.arrangement = PatternArrangement::kHorizontal;
    row.profile = PatternProfile::kGaussian;
    row.grid = 16;
    row.column = 1;
    row.row = 5;
    row.influence = 2;
    Pattern box = Hat();
    box.profile = PatternProfile::kBox;
    box.grid = 16;
    box.column = 3;
    box.row = 11;
    Pattern hat = Hat();
    hat.column = hat.row = 3;
    Pattern small = box;
    small.grid = 8;
    small.column = 1;
    small.row = 2;
    for (const Pattern& pattern : {Pattern{}, Full(), box, row, hat, small}) {
      if (rig_.Difference(pattern).empty()) return pattern;
    }
    Pattern none = Full();  // something that was never asked for
    none.grid = 77;
    return none;
  }

 private:
  Rig rig_;
};

const bool kSoftware = RegisterProjectorConformance("DisplaySoftware", [] {
  return std::make_unique<DisplayFixture>("renderer = \"software\"\n");
});
const bool kAccelerated = RegisterProjectorConformance("DisplayAccelerated", [] {
  return std::make_unique<DisplayFixture>("renderer = \"accelerated\"\n");
});

// ---- Pixels

TEST(Display, EveryPixelIsThePatterns) {
  for (const char* renderer : {"software", "accelerated"}) {
    for (double gamma : {1.0, 2.2}) {
      Rig rig(absl::StrCat("renderer = \"", renderer, "\"\ngamma = ", gamma, "\n"));
      auto projector = rig.Open();
      ASSERT_TRUE(projector.ok()) << projector.status();
      EXPECT_EQ(rig.Difference(Pattern{}), "") << "black after opening";
      ASSERT_TRUE(rig.Show(**projector, Hat()).ok());
      EXPECT_EQ(rig.Difference(Hat(), gamma), "") << renderer << ", gamma " << gamma;
      projector->reset();
      EXPECT_EQ(rig.Difference(Pattern{}), "") << "black after closing";
    }
  }
}

TEST(Display, HidesThePointer) {
  Rig rig("renderer = \"software\"\n", kWidth, kHeight, true);
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  EXPECT_EQ(rig.Difference(Pattern{}), "");
  ASSERT_TRUE(rig.Show(**projector, Hat()).ok());
  EXPECT_EQ(rig.Difference(Hat()), "");
  projector->reset();
  EXPECT_NE(rig.Difference(Pattern{}), "") << "the server's own pointer: there was one to hide";
}

TEST(Display, DescribesTheOutput) {
  Rig rig;
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  const ProjectorInfo& info = (*projector)->info();
  EXPECT_EQ(info.identity.driver, "display");
  EXPECT_EQ(info.identity.model, "output screen");
  EXPECT_EQ(info.width, kWidth);
  EXPECT_EQ(info.height, kHeight);
  EXPECT_EQ(info.settle, Duration::zero());
}

TEST(Display, TwoAreOpenAtATime) {
  Rig one, other("renderer = \"accelerated\"\n");
  auto first = one.Open(), second = other.Open();
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_TRUE(second.ok()) << second.status();
  ASSERT_TRUE(one.Show(**first, Hat()).ok());
  ASSERT_TRUE(other.Show(**second, Full()).ok());
  EXPECT_EQ(one.Difference(Hat()), "");
  EXPECT_EQ(other.Difference(Full()), "");
  one.xvfb->Kill();
  EXPECT_EQ(ErrorReason(one.Show(**first, Full())), "DEVICE_LOST");
  EXPECT_TRUE(other.Show(**second, Hat()).ok()) << "the other does not care";
}

TEST(Screen, ShowsColours) {
  Rig rig;
  ScreenOptions options;
  options.x_display = rig.xvfb->display();
  options.output = "screen";
  options.renderer = "software";
  auto screen = Screen::Open(options, kWidth, kHeight);
  ASSERT_TRUE(screen.ok()) << screen.status();
  std::vector<uint8_t> rgb(kWidth * kHeight * 3, 0);
  rgb[0] = 1;
  rgb[4] = 2;
  rgb[8] = 3;
  rgb.back() = 200;
  ASSERT_TRUE((*screen)->Show(rgb, 3).ok());
  absl::StatusOr<XwdPicture> picture = ParseXwd(rig.xvfb->screen());
  ASSERT_TRUE(picture.ok());
  EXPECT_EQ(picture->pixels[0], 0x010000u);
  EXPECT_EQ(picture->pixels[1], 0x000200u);
  EXPECT_EQ(picture->pixels[2], 0x000003u);
  EXPECT_EQ(picture->pixels.back(), 200u);
  EXPECT_EQ(ErrorReason((*screen)->Show(rgb, 1)), "RASTER");
}

// ---- What can not be opened

TEST(Display, AnotherSizeIsRefusedNamingBoth) {
  Rig rig("renderer = \"software\"\n", 640, 480);
  absl::Status opened = rig.Open().status();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE") << opened;
  EXPECT_NE(opened.message().find("320x200"), std::string_view::npos) << opened;
  EXPECT_NE(opened.message().find("640x480"), std::string_view::npos) << opened;
}

TEST(Display, AnOutputThatIsNotThereIsNamedWithThoseThatAre) {
  Rig rig;
  ScreenOptions options;
  options.x_display = rig.xvfb->display();
  options.output = "HDMI-7";
  absl::Status opened = Screen::Open(options, kWidth, kHeight).status();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_NOT_FOUND") << opened;
  EXPECT_NE(opened.message().find("HDMI-7"), std::string_view::npos) << opened;
  EXPECT_NE(opened.message().find("screen (320x200)"), std::string_view::npos) << opened;
}

TEST(Display, AServerThatIsNotThereIsSaidToBe) {
  ScreenOptions options;
  options.x_display = ":63999";
  options.output_index = 0;
  absl::Status opened = Screen::Open(options, kWidth, kHeight).status();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_NOT_FOUND") << opened;
  EXPECT_NE(opened.message().find(":63999"), std::string_view::npos) << opened;
}

TEST(DisplayDiscovery, FindsTheOutputs) {
  Rig rig;
  setenv("DISPLAY", rig.xvfb->display().c_str(), 1);
  auto found = DisplayDiscovery()();
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 1u);
  EXPECT_NE(found->front().what.find("output screen, 320x200"), std::string::npos);
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse(found->front().toml, "found.toml");
  ASSERT_TRUE(document.ok()) << document.status();
  const TomlTable table = document->root().Table("projector");
  EXPECT_EQ(table.String("driver"), "display");
  DisplayDriver().parse(table);
  EXPECT_TRUE(document->Finish().ok()) << document->Finish();
  setenv("DISPLAY", ":63999", 1);
  EXPECT_EQ(ErrorReason(DisplayDiscovery()().status()), "DEVICE_NOT_FOUND");
}

// ---- Displays that go away

TEST(DisplayLoss, WhileIdle) {
  Rig rig;
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  ASSERT_TRUE(rig.Show(**projector, Full()).ok());
  rig.xvfb->Kill();
  SleepFor(rig.clock, milliseconds(500));
  absl::Status shown = rig.Show(**projector, Hat());
  EXPECT_EQ(ErrorReason(shown), "DEVICE_LOST") << shown;
  EXPECT_EQ(shown.code(), absl::StatusCode::kUnavailable);
  EXPECT_NE(shown.message().find("connection to the X server broke"), std::string_view::npos)
      << shown;
  // Nobody there: connecting anew says so.
  EXPECT_EQ(ErrorReason(rig.Show(**projector, Hat())), "DEVICE_NOT_FOUND");
}

TEST(DisplayLoss, DuringShow) {
  Rig rig("renderer = \"software\"\nframes = 60\n");  // a second
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  Pending<ProjectorState> done(rig.clock);
  (*projector)->Show(Full(), rig.clock.Now() + seconds(60), done.sink());
  SleepFor(rig.clock, milliseconds(300));
  rig.xvfb->Kill();
  absl::Status shown = done.Wait(kNever, "Show").status();
  EXPECT_EQ(ErrorReason(shown), "DEVICE_LOST") << shown;
}

TEST(DisplayLoss, AServerThatHangsIsSilentAndTheNextShowFindsItAgain) {
  Rig rig;
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  rig.xvfb->Suspend(true);
  EXPECT_EQ(ErrorReason(rig.Show(**projector, Full())), "DEVICE_SILENT");
  rig.xvfb->Suspend(false);
  EXPECT_TRUE(rig.Show(**projector, Hat()).ok());
  EXPECT_EQ(rig.Difference(Hat()), "");
}

TEST(DisplayLoss, AScreenProcessThatCrashesTakesNobodyAlong) {
  Rig rig;
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  int killed = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream children(entry.path() / "children");
    for (pid_t pid = 0; children >> pid;) {
      std::ifstream comm(absl::StrCat("/proc/", pid, "/comm"));
      std::string name;
      std::getline(comm, name);
      if (name.starts_with("lightstage-scre")) killed += kill(pid, SIGSEGV) == 0;
    }
  }
  ASSERT_EQ(killed, 1);
  absl::Status shown = rig.Show(**projector, Full());
  EXPECT_EQ(ErrorReason(shown), "DEVICE_LOST") << shown;
  EXPECT_TRUE(rig.Show(**projector, Full()).ok()) << "connected anew";
  EXPECT_EQ(rig.Difference(Full()), "");
}

// ---- What others do to the screen

TEST(DisplayCovered, AWindowAboveIsFoundOrRaisedOver) {
  Rig rig("renderer = \"software\"\nframes = 20\n");
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  XIntruder intruder(rig.xvfb->display());
  intruder.Cover();
  EXPECT_NE(rig.Difference(Pattern{}), "") << "it covers";
  EXPECT_TRUE(rig.Show(**projector, Hat()).ok()) << "ours is raised first";
  EXPECT_EQ(rig.Difference(Hat()), "");
  Pending<ProjectorState> done(rig.clock);
  (*projector)->Show(Hat(), rig.clock.Now() + seconds(60), done.sink());
  while (!done.done()) {
    intruder.Raise();
    SleepFor(rig.clock, milliseconds(2));
  }
  absl::Status shown = done.Wait(kNever, "Show").status();
  EXPECT_EQ(ErrorReason(shown), "DEVICE_FAULT") << shown;
  EXPECT_NE(shown.message().find("pixel (10, 10)"), std::string_view::npos) << shown;
  intruder.Uncover();
  EXPECT_TRUE(rig.Show(**projector, Full()).ok());
}

// Whatever was above the picture while it was exposed, and for how long.
TEST(DisplayCovered, AWindowThatCameAndWentIsTold) {
  Rig rig;
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  const auto check = [&] {
    Pending<std::monostate> done(rig.clock);
    (*projector)->Check(rig.clock.Now() + seconds(60), done.sink());
    return done.Wait(kNever, "Check").status();
  };
  XIntruder intruder(rig.xvfb->display());
  for (bool idle : {false, true}) {
    ASSERT_TRUE(rig.Show(**projector, Hat()).ok());
    EXPECT_TRUE(check().ok()) << check();
    intruder.Cover();
    EXPECT_EQ(ErrorReason(check()), "DEVICE_FAULT") << "it is there";
    ASSERT_TRUE(rig.Show(**projector, Hat()).ok());
    EXPECT_TRUE(check().ok()) << "raised over: " << check();
    intruder.Raise();
    intruder.Uncover();
    if (idle) SleepFor(rig.clock, milliseconds(500));
    const absl::Status went = check();
    EXPECT_EQ(ErrorReason(went), "DEVICE_FAULT") << went;
  }
  ASSERT_TRUE(rig.Show(**projector, Full()).ok());
  EXPECT_TRUE(check().ok()) << check();
}

TEST(DisplayChanged, IsFoundAndNamesBothModes) {
  for (bool idle : {true, false}) {
    Rig rig;
    auto projector = rig.Open();
    ASSERT_TRUE(projector.ok()) << projector.status();
    ASSERT_TRUE(rig.Show(**projector, Full()).ok());
    ASSERT_TRUE(rig.xvfb->ChangeMode().ok());
    if (idle) SleepFor(rig.clock, milliseconds(600));
    absl::Status shown = rig.Show(**projector, Hat());
    EXPECT_EQ(ErrorReason(shown), "DISPLAY_CHANGED") << shown;
    EXPECT_NE(shown.message().find("320x200"), std::string_view::npos) << shown;
    EXPECT_NE(shown.message().find("319x200"), std::string_view::npos) << shown;
    // It stays so until the mode is right again.
    EXPECT_EQ(ErrorReason(rig.Show(**projector, Hat())), "DEVICE_UNSUITABLE");
    ASSERT_TRUE(rig.xvfb->Restore().ok());
    EXPECT_TRUE(rig.Show(**projector, Hat()).ok());
  }
}

absl::Status Check(Rig& rig, Projector& projector) {
  Pending<std::monostate> checked(rig.clock);
  projector.Check(rig.clock.Now() + seconds(60), checked.sink());
  return checked.Wait(kNever, "Check").status();
}

// What comes between the screen and the projector can not be read back from the screen.
TEST(DisplayGamma, IsSetStraightAndAnotherOneIsFound) {
  Rig rig;
  XIntruder intruder(rig.xvfb->display());
  intruder.SetGamma(1.4);
  ASSERT_EQ(intruder.Gamma().size(), 256u);
  ASSERT_LT(intruder.Gamma()[128], 0x7000);
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  std::vector<uint16_t> straight;
  for (int code = 0; code < 256; ++code) straight.push_back(static_cast<uint16_t>(code * 257));
  EXPECT_EQ(intruder.Gamma(), straight);
  for (bool idle : {true, false}) {
    for (const Pattern& pattern : {Full(), Pattern{}}) {
      absl::Status shown = rig.Show(**projector, pattern);
      ASSERT_TRUE(shown.ok()) << shown;
      EXPECT_EQ(intruder.Gamma(), straight);
      EXPECT_TRUE(Check(rig, **projector).ok());
      intruder.SetGamma(1.01);
      if (idle) {
        SleepFor(rig.clock, seconds(2));  // it looks five times a second
        intruder.SetGamma(1);             // it was there for a while
      }
      const absl::Status found = Check(rig, **projector);
      EXPECT_EQ(ErrorReason(found), "DEVICE_FAULT") << found;
      EXPECT_NE(found.message().find("gamma table"), std::string_view::npos) << found;
    }
  }
}

// And what was on the screen stays there, black for one.
TEST(DisplayCompositor, IsRefusedAtOpeningAndFoundLater) {
  Rig rig;
  XIntruder intruder(rig.xvfb->display());
  intruder.PaintRoot();
  ASSERT_NE(rig.Difference(Pattern{}), "");
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  ASSERT_TRUE(rig.Show(**projector, Full()).ok());
  intruder.PoseAsCompositor(true);
  for (const Pattern& pattern : {Full(), Pattern{}}) {
    const absl::Status refused = rig.Show(**projector, pattern);
    EXPECT_EQ(ErrorReason(refused), "DEVICE_FAULT") << refused;
    EXPECT_NE(refused.message().find("compositor"), std::string_view::npos) << refused;
    SleepFor(rig.clock, milliseconds(100));
    EXPECT_EQ(rig.Difference(pattern), "");
  }
  projector->reset();
  EXPECT_EQ(ErrorReason(rig.Open().status()), "DEVICE_FAULT");
  intruder.PoseAsCompositor(false);
  projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  EXPECT_TRUE(rig.Show(**projector, Full()).ok());
}

TEST(DisplayLoss, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  Rig rig;
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  bool full = false;
  CheckUnplugging(rig.clock, "projector",
                  {.plug =
                       [&](bool plugged) {
                         const absl::Status done =
                             plugged ? rig.xvfb->Restore() : rig.xvfb->SwitchOff();
                         EXPECT_TRUE(done.ok()) << done;
                       },
                   .use = [&] { return rig.Show(**projector, (full = !full) ? Full() : Hat()); },
                   .recover = [&] { return rig.Show(**projector, Pattern{}); }});
}

TEST(DisplayLoss, AnOutputThatIsSwitchedOff) {
  Rig rig;
  auto projector = rig.Open();
  ASSERT_TRUE(projector.ok()) << projector.status();
  ASSERT_TRUE(rig.xvfb->SwitchOff().ok());
  absl::Status shown = rig.Show(**projector, Full());
  EXPECT_EQ(ErrorReason(shown), "DEVICE_LOST") << shown;
  EXPECT_NE(shown.message().find("output screen"), std::string_view::npos) << shown;
}

}  // namespace
}  // namespace lightstage
