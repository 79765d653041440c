// A capture through the wire a real camera would use: GVCP and GVSP on loopback, the aravis driver, and a camera that nobody can tell
// from one made of glass.
#include "gtest/gtest.h"
#include "tests/harness/compare.h"

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

  const BasisComparison same = CompareBasis(direct, direct_run, wire, wire_run, 12, 0.016);
  EXPECT_EQ(same.images, 16);
  EXPECT_LE(same.worst, 1.0) << same.where;
}

}  // namespace
}  // namespace lightstage
