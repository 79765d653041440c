// What the simulated projector makes of what is on its screen.
#include "sim/peers/display/projector.h"

#include <unistd.h>

#include "absl/strings/str_cat.h"
#include "base/clock.h"
#include "drivers/display/screen.h"
#include "gtest/gtest.h"
#include "sim/peers/display/x_intruder.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr int kWidth = 64, kHeight = 48;
// Others may run at the same time.
const std::string kDisplay = absl::StrCat(":", 10000 + getpid() % 50000);

struct Bench {
  Bench() {
    RigGeometry geometry;
    geometry.camera = {Vec3(0, -1.1, 0.55), Vec3(0, 0, 0.075), Degrees(17)};
    geometry.projector.present = true;
    geometry.projector.width = kWidth;
    geometry.projector.height = kHeight;
    world = *World::Create({}, geometry, clock);
    auto started = DisplayProjector::Start(kDisplay, kWidth, kHeight, LightOf(world));
    EXPECT_TRUE(started.ok()) << started.status();
    if (started.ok()) projector = *std::move(started);
  }
  absl::StatusOr<std::unique_ptr<Screen>> Open() const {
    return Screen::Open(
        {.x_display = kDisplay, .output = "screen", .renderer = "software", .frames = 1}, kWidth,
        kHeight);
  }
  // The codes that shine; nothing if it is dark.
  std::vector<uint8_t> Codes() {
    projector->ScanOut();
    const Projection shown = world->Shown(clock.Now());
    const PixelCodes* codes = std::get_if<PixelCodes>(&shown);
    return codes != nullptr ? **codes : std::vector<uint8_t>();
  }

  RealClock clock;
  std::shared_ptr<World> world;
  std::unique_ptr<DisplayProjector> projector;
};

std::vector<uint8_t> Ramp() {
  std::vector<uint8_t> codes(kWidth * kHeight);
  for (size_t i = 0; i < codes.size(); ++i) codes[i] = static_cast<uint8_t>(i % 251 + 1);
  return codes;
}

TEST(DisplayProjector, ShinesWhatIsOnItsScreen) {
  Bench bench;
  EXPECT_TRUE(bench.Codes().empty());
  auto screen = bench.Open();
  ASSERT_TRUE(screen.ok()) << screen.status();
  ASSERT_TRUE((*screen)->Show(Ramp(), 1).ok());
  EXPECT_EQ(bench.Codes(), Ramp());
  // Whoever drew it.
  XIntruder intruder(kDisplay);
  intruder.Cover();
  std::vector<uint8_t> covered = Ramp();
  for (int y = 10; y < 30; ++y) {
    for (int x = 10; x < 30; ++x) covered[y * kWidth + x] = 255;
  }
  EXPECT_EQ(bench.Codes(), covered);
  intruder.Uncover();
  screen->reset();
  EXPECT_TRUE(bench.Codes().empty()) << "black after closing";
}

TEST(DisplayProjector, NeedsNobodyToScanOut) {
  Bench bench;
  auto screen = bench.Open();
  ASSERT_TRUE(screen.ok()) << screen.status();
  ASSERT_TRUE((*screen)->Show(Ramp(), 1).ok());
  const TimePoint late = bench.clock.Now() + std::chrono::seconds(20);
  while (!std::holds_alternative<PixelCodes>(bench.world->Shown(bench.clock.Now())) &&
         bench.clock.Now() < late) {
    SleepFor(bench.clock, milliseconds(5));
  }
  EXPECT_EQ(*std::get<PixelCodes>(bench.world->Shown(bench.clock.Now())), Ramp());
}

TEST(DisplayProjector, IsDarkWithoutASignalThatItKnows) {
  Bench bench;
  for (auto fault : {&DisplayProjector::SwitchOff, &DisplayProjector::ChangeMode}) {
    auto screen = bench.Open();
    ASSERT_TRUE(screen.ok()) << screen.status();
    ASSERT_TRUE((*screen)->Show(Ramp(), 1).ok());
    ASSERT_TRUE((*bench.projector.*fault)(true).ok());
    EXPECT_TRUE(bench.Codes().empty());
    EXPECT_FALSE((*screen)->Check().ok());
    ASSERT_TRUE((*bench.projector.*fault)(false).ok());
  }
}

TEST(DisplayProjector, IsDarkWithoutAServerUntilThereIsAnother) {
  Bench bench;
  auto screen = bench.Open();
  ASSERT_TRUE(screen.ok()) << screen.status();
  ASSERT_TRUE((*screen)->Show(Ramp(), 1).ok());
  bench.projector->EndServer(true);
  const TimePoint late = bench.clock.Now() + std::chrono::seconds(20);
  while (!bench.Codes().empty() && bench.clock.Now() < late) SleepFor(bench.clock, milliseconds(5));
  EXPECT_TRUE(bench.Codes().empty());
  EXPECT_FALSE((*screen)->Check().ok());
  bench.projector->EndServer(false);
  while (!(screen = bench.Open()).ok() && bench.clock.Now() < late) {
  }
  ASSERT_TRUE(screen.ok()) << screen.status();
  ASSERT_TRUE((*screen)->Show(Ramp(), 1).ok());
  EXPECT_EQ(bench.Codes(), Ramp());
}

TEST(DisplayProjector, ADisplayThatIsServedAlreadyIsRefused) {
  Bench bench;
  const absl::Status second =
      DisplayProjector::Start(kDisplay, kWidth, kHeight, LightOf(bench.world)).status();
  EXPECT_EQ(ErrorReason(second), "PEER_NOT_STARTED") << second;
  EXPECT_NE(second.message().find(kDisplay), std::string_view::npos) << second;
}

}  // namespace
}  // namespace lightstage::sim
