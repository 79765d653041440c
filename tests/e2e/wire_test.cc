// Captures through wires that every machine has, or can have within the process: Modbus TCP and a serial line for the axes and lamps, GigE Vision for
// the camera, an X server for the projector; a DMX USB Pro, and the LightCrafter that takes its patterns from the X server. Those that need
// a kernel with buses are in wire_vm_test.cc.
#include <string>

#include "drivers/conformance/private_network.h"
#include "gtest/gtest.h"
#include "tests/harness/compare.h"

namespace lightstage {
namespace {

[[maybe_unused]] const bool kPrivateNetwork = EnterPrivateNetwork();

constexpr char kServo[] =
    "max_velocity_dps = 720\nmax_acceleration_dps2 = 7200\nsettle_ms = 10\npoll_ms = 5\n"
    "steps_per_degree = 1000\n";

std::string DirectRig() {
  return Replaced(WithoutNoise(SmallRig()), "format = \"RGB16\"", "format = \"BayerRG16\"");
}

// The same with the camera, turntable and gantry on wires; the gantry's ends in `folder`.
std::string WireRig(const TestFolder& folder) {
  std::string rig = WithTable(RealTime(DirectRig()), "turntable",
                              "driver = \"sim-modbus\"\nprofile = \"oriental-motor-az\"\n"
                              "continuous = true\nhost = \"127.0.0.1\"\nport = 502\n" +
                                  std::string(kServo));
  rig = WithTable(rig, "tilt",
                  "driver = \"sim-modbus\"\nprofile = \"applied-motion\"\nmin_deg = 0\n"
                  "max_deg = 90\nbaud = 115200\nparity = \"none\"\nserial_port = \"" +
                      folder.path().string() + "/drive\"\n" + kServo);
  rig = WithTable(rig, "camera", SimGige("BayerRG16", "1000, 16000"));
  return WithTable(rig, "camera.options",
                   SimGigeOptions(7000) + "[camera.options.peer]\n" + kSimGigePeer);
}

TEST(Wire, ALightStageOverModbusAndGigEEqualsTheDirectOne) {
  TestFolder folder;
  ExpectSame(folder, DirectRig(),
             WithTable(WireRig(folder), "lamps",
                       "driver = \"sim-modbus\"\nkind = \"coils\"\ncount = 40\nsettle_ms = 2\n"
                       "host = \"127.0.0.1\"\nport = 503\n"),
             {"light-stage", "--azimuths", "8"}, 320, 0.016);
}

TEST(Wire, ALightStageOverADmxUsbProEqualsTheDirectOne) {
  TestFolder folder;
  ExpectSame(folder, DirectRig(),
             WithTable(WireRig(folder), "lamps",
                       "driver = \"sim-dmx\"\nwidget = \"pro\"\nserial = \"LAMPS1\"\nslots = 80\n"
                       "first_channel = 1\nlamp_count = 40\nbits = 16\nsettle_ms = 2\n"
                       "[lamps.peer]\nwire = \"process\"\n"),
             {"light-stage", "--azimuths", "8"}, 320, 0.016);
}

const std::vector<std::string> k4d = {
    "projector-4d", "--azimuths", "1", "--tilts", "20,50", "--grid", "8", "--influence", "1"};

TEST(Wire, A4dCaptureOnADisplayEqualsTheDirectOne) {
  TestFolder folder;
  ExpectSame(folder, DirectRig(), WithTable(WireRig(folder), "projector", SimDisplay()), k4d, 64,
             0.016);
}

TEST(Wire, A4dCaptureOverADlpc350sVideoInputEqualsTheDirectOne) {
  TestFolder folder;
  ExpectSame(folder, WithMirrors(DirectRig()),
             WithTable(WithMirrors(WireRig(folder)), "projector",
                       "driver = \"sim-dlpc350\"\nserial = \"PROJECTOR1\"\nmode = \"video\"\n"
                       "led_current = [100, 100, 100]\nled_current_limit = 150\n"
                       "[projector.display]\n" +
                           SimDisplayOutput() + "[projector.peer]\nwire = \"process\"\n"),
             k4d, 64, 0.016);
}

}  // namespace
}  // namespace lightstage
