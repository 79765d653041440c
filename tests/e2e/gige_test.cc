// A capture through the wire a real camera would use: GVCP and GVSP on loopback, the aravis driver, and a camera that nobody can tell
// from one made of glass.
#include <cmath>

#include "dataset/basis_exr.h"
#include "gtest/gtest.h"
#include "tests/harness/daemon.h"

namespace lightstage {
namespace {

// The small rig with a Bayer camera on real time, without noise.
std::string BayerRig() {
  return Replaced(WithoutNoise(RealTime(SmallRig())), "format = \"RGB16\"",
                  "format = \"BayerRG16\"");
}

TEST(Gige, ALightStageThroughTheWireEqualsTheDirectOne) {
  const std::vector<std::string> plan = {"light-stage", "--azimuths", "2", "--lamps", "4-11"};
  TestFolder direct_folder;
  Daemon direct(direct_folder, BayerRig());
  std::string direct_run = direct.Capture(plan);

  // An address of its own, so that the fixed port is free.
  std::string rig =
      Replaced(BayerRig(), "driver = \"sim\"\nformat", "driver = \"sim-gige\"\nformat");
  rig = Replaced(
      rig, "[camera.options]\nsensor_width = 64\nsensor_height = 48\nbits = 12\nreadout_ms = 5\n",
      "[camera.options]\naddress = \"127.0.0.1\"\ngain_db_per_step = 1.0\npacket_size = 7000\n"
      "[camera.options.peer]\nsensor_width = 64\nsensor_height = 48\nbits = 12\n");
  TestFolder wire_folder;
  Daemon wire(wire_folder, rig);
  Json described = wire.Ctl({"rig"}).json();
  EXPECT_EQ(described["rig"]["devices"][0]["kind"], "DEVICE_KIND_CAMERA");
  std::string wire_run = wire.Capture(plan);

  Json run = wire.Run(wire_run);
  ASSERT_EQ(run["doneShots"], 16);
  double worst = 0;
  for (int shot = 0; shot < 16; ++shot) {
    char name[32];
    std::snprintf(name, sizeof name, "basis/%06d.exr", shot);
    auto a = ReadBasisExr((direct.RunFolder(direct_run) / name).string());
    auto b = ReadBasisExr((wire.RunFolder(wire_run) / name).string());
    ASSERT_TRUE(a.ok()) << a.status();
    ASSERT_TRUE(b.ok()) << b.status();
    ASSERT_TRUE(a->image.pixels.SameShape(b->image.pixels));
    for (size_t i = 0; i < a->image.pixels.pixels().size(); ++i) {
      double x = a->image.pixels.pixels()[i], y = b->image.pixels.pixels()[i];
      // One code of 12 bits in the longer exposure, 16 ms, and one step of the file's half precision.
      double step = 1.0 / 4095 / 0.016 + std::max(x, y) / 1024;
      worst = std::max(worst, std::abs(x - y) / step);
    }
  }
  EXPECT_LE(worst, 1.0) << "in units of one code";
}

}  // namespace
}  // namespace lightstage
