// Captures through wires that need a kernel with buses (tests/vm): every device but the gantry's drive is behind one. The world is the same as in the
// direct capture that each is compared with.
#include <string>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include "tests/harness/campaign.h"
#include "tests/harness/compare.h"

namespace lightstage {
namespace {

// On virtual time and without noise, so that what differs is what the wires did.
std::string DirectRig() {
  std::string rig = Replaced(WithoutNoise(SmallRig()), "format = \"RGB16\"", "format = \"Mono16\"");
  rig = Replaced(rig, "scene = \"default\"", "scene = \"balls\"");
  rig = WithMirrors(rig);
  rig = Replaced(rig, "exposures_us = [1000, 16000]", "exposures_us = [1000]");
  // Patient: this machine is emulated, and the lanes beside this one keep it busy.
  rig = Replaced(rig, "device_timeout_ms = 1000", "device_timeout_ms = 10000");
  return Replaced(rig, "heartbeat_ms = 1000", "heartbeat_ms = 20000");
}

// The same with the camera, turntable and gantry on wires; `peer`: what the turntable's has besides.
std::string WireRig(const std::string& peer = "") {
  std::string rig = WithTable(RealTime(DirectRig()), "camera", SimGige("Mono16", "1000"));
  rig = WithTable(rig, "camera.options",
                  SimGigeOptions(7000) + "[camera.options.peer]\n" + kSimGigePeer);
  rig = WithTable(rig, "turntable",
                  "driver = \"sim-canopen\"\ninterface = \"vcan1\"\nnode = 5\ncontinuous = true\n"
                  "units_per_turn = 36000\nmax_velocity_dps = 360\nmax_acceleration_dps2 = 3600\n"
                  "settle_ms = 20\nhoming_method = 19\nhoming_velocity_dps = 360\n"
                  "answer_ms = 1000\nheartbeat_ms = 4000\nsetpoint_ms = 1000\n"
                  "[turntable.peer]\n" +
                      peer);
  return WithTable(rig, "tilt",
                   "driver = \"sim-modbus\"\nprofile = \"leadshine-rs\"\nmin_deg = 0\n"
                   "max_deg = 90\nhost = \"127.0.0.1\"\nport = 502\nsteps_per_degree = 1000\n"
                   "max_velocity_dps = 360\nmax_acceleration_dps2 = 3600\nsettle_ms = 20\n"
                   "response_timeout_ms = 1000\n");
}

constexpr char kDmxLamps[] =
    "driver = \"sim-dmx\"\nwidget = \"open\"\nserial = \"LAMPS1\"\nslots = 40\n"
    "first_channel = 1\nlamp_count = 40\nsettle_ms = 40\n[lamps.peer]\n";
// Seldom enough for a run to come to its end. The seeds begin with what no other test does on the kernel's buses: the drive's fault and a power
// cycle; short reports, unplugged, the sequencer stopped, an LED setting that is not taken.
constexpr char kCanFaults[] = "fault_interval_s = 10\nfault_after_s = 3\nfault_seed = 212\n";
constexpr char kDmxFaults[] = "fault_interval_s = 20\nfault_after_s = 3\n";
constexpr char kHidFaults[] = "fault_interval_s = 4\nfault_after_s = 3\nfault_seed = 113\n";

using Plan = std::vector<std::string>;
const Plan kLightStage = {"light-stage", "--azimuths", "8"};
const Plan kEightLamps = {"light-stage", "--azimuths", "1", "--lamps", "0-7"};
const Plan kTwiceEightLamps = {"light-stage", "--azimuths", "2", "--lamps", "0-7"};
const Plan kSixteenLamps = {"light-stage", "--azimuths", "1", "--lamps", "0-15"};
const Plan k4d = {"projector-4d", "--azimuths", "1",           "--tilts", "20,50",
                  "--grid",       "8",          "--influence", "1"};

// The camera of the rig that has a USB camera exposes twice.
std::string UvcDirectRig() {
  return Replaced(DirectRig(), "exposures_us = [1000]", "exposures_us = [1000, 16000]");
}

// What all others are compared with; run outside of the virtual machine, before it (tests/vm/run).
TEST(Direct, RunsAreCaptured) {
  TestFolder folder;
  for (const Plan& plan : {kLightStage, kEightLamps, kTwiceEightLamps, k4d}) {
    DirectRun(folder, DirectRig(), plan);
  }
  for (const Plan& plan : {kTwiceEightLamps, kSixteenLamps})
    DirectRun(folder, UvcDirectRig(), plan);
}

TEST(WireVm, ALightStageOverCanopenDmxAndGigEEqualsTheDirectOne) {
  ExpectSame(TestFolder(), DirectRig(), WithTable(WireRig(), "lamps", kDmxLamps), kLightStage, 320,
             0.001);
}

TEST(WireVm, LampsOnACanopenModuleEqualTheDirectOnes) {
  ExpectSame(TestFolder(), DirectRig(),
             WithTable(WireRig(), "lamps",
                       "driver = \"sim-canopen\"\ninterface = \"vcan1\"\nnode = 9\n"
                       "output = \"digital\"\nsettle_ms = 5\nanswer_ms = 1000\n"
                       "heartbeat_ms = 4000\n"),
             kEightLamps, 8, 0.001);
}

// Where all horizontal and vertical patterns of an 8 x 8 grid with one dark square between lit ones are in the flash.
std::string Flash() {
  std::string tables;
  int place = 0;
  const auto add = [&](const char* arrangement, int column, int row) {
    absl::StrAppend(&tables, "\n[[projector.patterns]]\narrangement = \"", arrangement,
                    "\"\ngrid = 8\ninfluence = 1\ncolumn = ", column, "\nrow = ", row,
                    "\nimage = ", place / 24, "\nnumber = ", place % 24, "\ndepth = 1\n");
    ++place;
  };
  for (int along = 0; along < 8; ++along) {
    for (int offset = 0; offset < 2; ++offset) {
      add("horizontal", offset, along);
      add("vertical", along, offset);
    }
  }
  return tables;
}

std::string Dlpc350(const std::string& serial, const std::string& peer = "") {
  return "driver = \"sim-dlpc350\"\nserial = \"" + serial +
         "\"\nmode = \"flash\"\n"
         "led_current = [100, 100, 100]\nled_current_limit = 150\n" +
         Flash() + "[projector.peer]\n" + peer;
}

TEST(WireVm, A4dCaptureOverADlpc350EqualsTheDirectOne) {
  ExpectSame(TestFolder(), DirectRig(), WithTable(WireRig(), "projector", Dlpc350("PROJECTOR1")),
             k4d, 64, 0.001);
}

TEST(WireVmFaults, AreRetakenOrPause) {
  Campaign(DirectRig(),
           WithTable(WireRig(kCanFaults), "lamps", std::string(kDmxLamps) + kDmxFaults),
           kTwiceEightLamps, 4, 0.001);
}

TEST(WireVmHidFaults, AreRetakenOrPause) {
  Campaign(DirectRig(),
           WithTable(RealTime(DirectRig()), "projector", Dlpc350("PROJECTOR2", kHidFaults)), k4d, 4,
           0.001);
}

// The simulated USB camera of the table `camera`, and what its peer has besides the sensor's size.
std::string UvcRig(const std::string& rig, const std::string& peer) {
  const std::string small =
      WithTable(rig, "camera",
                "driver = \"sim-v4l2\"\nformat = \"Mono16\"\nwidth = 64\nheight = 48\n"
                "exposures_us = [1000, 16000]\n");
  return WithTable(small, "camera.options",
                   "card = \"Simulated camera\"\nframes_per_s = 20\nsignificant_bits = 12\n"
                   "control_delay_frames = 0\n"
                   "[camera.options.peer]\nsensor_width = 64\nsensor_height = 48\n" +
                       peer);
}

TEST(WireVmUvc, ALightStageThroughUvcvideoEqualsTheDirectOne) {
  ExpectSame(TestFolder(), UvcDirectRig(), UvcRig(RealTime(UvcDirectRig()), ""), kTwiceEightLamps,
             16, 0.016);
}

TEST(WireVmUvc, FaultsAreRetakenOrPause) {
  Campaign(UvcDirectRig(),
           UvcRig(RealTime(UvcDirectRig()), "fault_interval_s = 2\nfault_after_s = 3\n"),
           kSixteenLamps, 8);
}

}  // namespace
}  // namespace lightstage
