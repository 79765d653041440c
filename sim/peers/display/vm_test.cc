// drivers/display on the kernel's own graphics (KMS), on two of QEMU's bochs-display; what they scan out is read from the cards. For a virtual
// machine with nothing on its console (tests/vm), as root; not among the usual tests.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>
#include <xf86drm.h>
#include <xf86drmMode.h>
extern "C" {
#include <sys/pidfd.h>  // of glibc 2.36, which forgets to say so
}

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "drivers/display/driver.h"
#include "drivers/display/raster.h"
#include "drivers/display/screen.h"
#include "sim/peers/display/bochs_scanout.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// An output as the kernel calls it, and the card that it is the only one of.
class Output {
 public:
  explicit Output(int card) : card_(card) {
    const std::string folder = absl::StrCat("/sys/class/drm/card", card);
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with(absl::StrCat("card", card, "-"))) connector_ = entry.path();
    }
    std::error_code error;
    auto scanout = BochsScanout::Map(std::filesystem::canonical(folder + "/device", error));
    EXPECT_TRUE(scanout.ok()) << scanout.status();
    if (scanout.ok()) scanout_ = *std::move(scanout);
    // The native mode is the first detailed timing of what the monitor says of itself (EDID).
    std::ifstream file(connector_ / "edid", std::ios::binary);
    const std::vector<uint8_t> edid(std::istreambuf_iterator<char>(file), {});
    EXPECT_GE(edid.size(), 128u);
    if (edid.size() < 128) return;
    width_ = edid[56] | (edid[58] & 0xf0) << 4;
    height_ = edid[59] | (edid[61] & 0xf0) << 4;
    const int columns = width_ + (edid[57] | (edid[58] & 0x0f) << 8);
    const int lines = height_ + (edid[60] | (edid[61] & 0x0f) << 8);
    refresh_hz_ = 1e4 * (edid[54] | edid[55] << 8) / (columns * lines);
  }

  std::string name() const {
    const std::string connector = connector_.filename().string();
    return connector.substr(connector.find('-') + 1);
  }
  int width() const { return width_; }
  int height() const { return height_; }
  double refresh_hz() const { return refresh_hz_; }
  std::string device() const { return absl::StrCat("/dev/dri/card", card_); }
  absl::StatusOr<ScannedOut> ScanOut() const { return scanout_->Read(); }
  // As if its cable were off, or on again.
  void Plug(bool in) const { std::ofstream(connector_ / "status") << (in ? "detect" : "off"); }
  // As a screen saver would, which only the card's master may: by the descriptor of `master`.
  void Sleep(pid_t master) const {
    const int process = pidfd_open(master, 0);
    bool asleep = false;
    for (const auto& entry :
         std::filesystem::directory_iterator(absl::StrCat("/proc/", master, "/fd"))) {
      std::error_code error;
      if (std::filesystem::read_symlink(entry, error) != device()) continue;
      const int card = pidfd_getfd(process, std::stoi(entry.path().filename()), 0);
      drmModeRes* resources = drmModeGetResources(card);
      const uint32_t id = resources != nullptr ? resources->connectors[0] : 0;
      drmModeFreeResources(resources);
      drmModeConnector* connector = drmModeGetConnectorCurrent(card, id);
      for (int i = 0; connector != nullptr && i < connector->count_props; ++i) {
        drmModePropertyRes* property = drmModeGetProperty(card, connector->props[i]);
        if (property != nullptr && std::string_view(property->name) == "DPMS") {
          asleep |=
              drmModeConnectorSetProperty(card, id, property->prop_id, DRM_MODE_DPMS_OFF) == 0;
        }
        drmModeFreeProperty(property);
      }
      drmModeFreeConnector(connector);
      close(card);
    }
    close(process);
    EXPECT_TRUE(asleep);
  }

  // The first pixel that is another one; also if the mode is not the native one.
  std::string Difference(const std::vector<uint32_t>& pixels) const {
    const absl::StatusOr<ScannedOut> out = ScanOut();
    if (!out.ok()) return MessageOf(out.status());
    if (out->width != width_ || out->height != height_) {
      return absl::StrCat("it runs at ", out->width, "x", out->height, " instead of ", width_, "x",
                          height_);
    }
    for (size_t i = 0; i < out->pixels.size(); ++i) {
      if (out->pixels[i] == pixels[i]) continue;
      return absl::StrFormat("pixel (%d, %d) is %06x instead of %06x", i % width_, i / width_,
                             out->pixels[i], pixels[i]);
    }
    return "";
  }
  std::string Difference(const Pattern& pattern) const {
    std::vector<uint32_t> pixels;
    for (uint8_t code : RasterOf(pattern, width_, height_, 1)) pixels.push_back(code * 0x010101u);
    return Difference(pixels);
  }

 private:
  const int card_;
  std::filesystem::path connector_;
  std::unique_ptr<BochsScanout> scanout_;
  int width_ = 0, height_ = 0;
  double refresh_hz_ = 0;
};

// The process that has the screen.
pid_t OnlyChild() {
  std::vector<pid_t> pids;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream children(task.path() / "children");
    for (pid_t pid = 0; children >> pid;) pids.push_back(pid);
  }
  EXPECT_EQ(pids.size(), 1u);
  return pids.empty() ? -1 : pids.front();
}

Pattern Of(PatternArrangement arrangement, PatternProfile profile, int grid, int column, int row) {
  Pattern pattern;
  pattern.arrangement = arrangement;
  pattern.profile = profile;
  pattern.grid = grid;
  pattern.column = column;
  pattern.row = row;
  return pattern;
}

constexpr int kFrames = 3;
constexpr int kTries = 3;  // a machine that is very busy may outlast the driver's patience
const Pattern kBlack;
const Pattern kFull = Of(PatternArrangement::kFull, PatternProfile::kBox, 1, 0, 0);
const Pattern kHat = Of(PatternArrangement::kSquare, PatternProfile::kHat, 4, 1, 2);
const Pattern kBox = Of(PatternArrangement::kSquare, PatternProfile::kBox, 16, 3, 11);
const Pattern kRow = Of(PatternArrangement::kHorizontal, PatternProfile::kGaussian, 16, 1, 5);

class KmsVm : public testing::Test {
 protected:
  // As a rig file does.
  absl::StatusOr<std::unique_ptr<Projector>> Open(const std::string& output) {
    geometry_.projector.present = true;
    geometry_.projector.width = one_.width();
    geometry_.projector.height = one_.height();
    ASSIGN_OR_RETURN(
        TomlDocument document,
        TomlDocument::Parse(absl::StrCat("[projector]\nbackend = \"kmsdrm\"\noutput = \"", output,
                                         "\"\nframes = ", kFrames, "\n"),
                            "rig.toml"));
    DeviceOpener<Projector> open = DisplayDriver().parse(document.root().Table("projector"));
    RETURN_IF_ERROR(document.Finish());
    absl::StatusOr<std::unique_ptr<Projector>> opened;
    for (int i = 0; i < kTries; ++i) {
      opened = open({"projector", &clock_, &geometry_});
      if (ErrorReason(opened.status()) != "DEVICE_SILENT") break;
    }
    return opened;
  }
  // Notes meanwhile where in the card's memory the picture is.
  absl::Status Show(Projector& projector, const Pattern& pattern) {
    absl::Status shown;
    for (int i = 0; i < kTries; ++i) {
      const TimePoint begin = clock_.Now();
      Pending<ProjectorState> done(clock_);
      projector.Show(pattern, begin + seconds(120), done.sink());
      while (!done.done()) {
        if (auto out = one_.ScanOut(); out.ok()) places_.insert(out->offset);
        SleepFor(clock_, milliseconds(5));
      }
      shown = done.Wait(kNever, "Show").status();
      took_ = clock_.Now() - begin;
      if (ErrorReason(shown) != "DEVICE_SILENT") break;
    }
    return shown;
  }

  RealClock clock_;
  RigGeometry geometry_;
  const Output one_{0}, other_{1};
  std::set<uint64_t> places_;
  Duration took_{};  // the last Show
};

ScreenOptions On(const Output& output) {
  return {.backend = "kmsdrm", .output = output.name(), .frames = 1};
}

TEST_F(KmsVm, OutputsAreListedByTheKernelsNamesInTheirNativeModes) {
  auto outputs = Screen::ListOutputs({.backend = "kmsdrm"});
  ASSERT_TRUE(outputs.ok()) << outputs.status();
  ASSERT_EQ(outputs->size(), 2u);
  EXPECT_NE(one_.name(), other_.name());
  EXPECT_NE(one_.width(), other_.width()) << "or nothing is told apart";
  for (const Output* output : {&one_, &other_}) {
    const ScreenInfo& info = (*outputs)[output == &other_];
    EXPECT_EQ(info.output, output->name());
    EXPECT_EQ(info.width, output->width());
    EXPECT_EQ(info.height, output->height());
    EXPECT_NEAR(info.refresh_hz, output->refresh_hz(), 0.01);
    EXPECT_EQ(info.note, "");
  }
}

TEST_F(KmsVm, TheSearchFindsThem) {
  const auto found = DisplayDiscovery()();
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 2u);
  const std::string& lines = (*found)[0].toml;
  EXPECT_NE(lines.find("backend = \"kmsdrm\"\noutput = \"" + one_.name() + "\""), std::string::npos)
      << lines;
}

TEST_F(KmsVm, WhatIsNotThereOrOfAnotherSizeIsRefused) {
  absl::Status opened = Screen::Open(On(other_), one_.width(), one_.height()).status();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE") << opened;
  opened = Open("HDMI-A-7").status();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_NOT_FOUND") << opened;
  for (const Output* output : {&one_, &other_}) {
    EXPECT_NE(opened.message().find(output->name()), std::string_view::npos) << opened;
  }
}

// SDL does not tell that the kernel refuses its pictures.
TEST_F(KmsVm, ACardThatAnotherProgramHasIsRefused) {
  const int card = open(one_.device().c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_GE(card, 0);
  ASSERT_EQ(drmSetMaster(card), 0);
  const absl::Status opened = Open(one_.name()).status();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_BUSY") << opened;
  close(card);
}

// Two at a time, each on the output of its name. Last, because a connector that was off has forgotten its monitor.
TEST_F(KmsVm, EveryPixelThatIsScannedOutIsThePatterns) {
  auto projector = Open(one_.name());
  ASSERT_TRUE(projector.ok()) << projector.status();
  EXPECT_EQ((*projector)->info().identity.model, "output " + one_.name());
  EXPECT_EQ(one_.Difference(kBlack), "") << "after opening";
  auto screen = Screen::Open(On(other_), other_.width(), other_.height());
  ASSERT_TRUE(screen.ok()) << screen.status();
  std::vector<uint8_t> rgb;
  std::vector<uint32_t> colours;
  for (int i = 0; i < other_.width() * other_.height(); ++i) {
    const uint32_t colour = static_cast<uint32_t>(i) * 2654435761u >> 8;  // all kinds
    colours.push_back(colour);
    for (int shift : {16, 8, 0}) rgb.push_back(static_cast<uint8_t>(colour >> shift));
  }
  absl::Status shown = (*screen)->Show(rgb, 3);
  for (int i = 1; i < kTries && ErrorReason(shown) == "DEVICE_SILENT"; ++i) {
    screen->reset();
    screen = Screen::Open(On(other_), other_.width(), other_.height());
    ASSERT_TRUE(screen.ok()) << screen.status();
    shown = (*screen)->Show(rgb, 3);
  }
  ASSERT_TRUE(shown.ok()) << shown;
  EXPECT_EQ(one_.Difference(kBlack), "") << "that is the other one's";
  double shortest_s = 1e9;
  for (const Pattern& pattern : {kHat, kFull, kRow, kBlack, kBox}) {
    shown = Show(**projector, pattern);
    shortest_s = std::min(shortest_s, Seconds(took_));
    ASSERT_TRUE(shown.ok()) << shown;
    EXPECT_EQ(one_.Difference(pattern), "");
    EXPECT_EQ(other_.Difference(colours), "");
  }
  EXPECT_GE(places_.size(), 2u) << "pictures are not flipped to, but drawn where they are seen";
  ASSERT_LT(one_.refresh_hz(), 11) << "or drawing would be what takes the time";
  std::printf("a pattern of %d frames at %.3g Hz took %.0f ms at least\n", kFrames,
              one_.refresh_hz(), shortest_s * 1e3);
  EXPECT_GE(shortest_s, 0.95 * (kFrames - 1) / one_.refresh_hz());
  screen->reset();
  EXPECT_EQ(other_.Difference(kBlack), "") << "after closing";
  EXPECT_EQ(one_.Difference(kBox), "") << "nobody asked for anything";

  one_.Plug(false);
  shown = Show(**projector, kHat);
  EXPECT_EQ(ErrorReason(shown), "DEVICE_LOST") << shown;
  EXPECT_NE(shown.message().find(one_.name()), std::string_view::npos) << shown;
  shown = Show(**projector, kHat);
  EXPECT_EQ(ErrorReason(shown), "DEVICE_NOT_FOUND") << shown;
  one_.Plug(true);
  shown = Show(**projector, kHat);
  EXPECT_TRUE(shown.ok()) << "connected anew: " << shown;
  EXPECT_EQ(one_.Difference(kHat), "");

  one_.Sleep(OnlyChild());
  shown = Show(**projector, kFull);
  EXPECT_EQ(ErrorReason(shown), "DEVICE_LOST") << shown;
  EXPECT_NE(shown.message().find("put to sleep"), std::string_view::npos) << shown;
  shown = Show(**projector, kFull);
  EXPECT_TRUE(shown.ok()) << "woken up: " << shown;
  EXPECT_EQ(one_.Difference(kFull), "");

  // Whoever takes the process away takes the picture too.
  ASSERT_EQ(kill(OnlyChild(), SIGKILL), 0);
  const TimePoint late = clock_.Now() + seconds(20);
  while (!one_.Difference(kBlack).empty() && clock_.Now() < late) {
    SleepFor(clock_, milliseconds(20));
  }
  EXPECT_EQ(one_.Difference(kBlack), "");
}

}  // namespace
}  // namespace lightstage::sim
