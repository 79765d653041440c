// Captures through wires that need a kernel with buses (tests/vm): every device but the gantry's drive is behind one. The world is the same as in the
// direct capture that each is compared with.
#include <iostream>
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
  rig = Replaced(rig, "width = 256\nheight = 192", "width = 912\nheight = 1140");
  rig = Replaced(rig, "exposures_us = [1000, 16000]", "exposures_us = [1000]");
  // Patient: this machine is emulated.
  return Replaced(rig, "device_timeout_ms = 1000", "device_timeout_ms = 10000");
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
// Seldom enough for a run to come to its end.
constexpr char kFaults[] = "fault_interval_s = 10\nfault_after_s = 3\n";

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
  Campaign(DirectRig(), WithTable(WireRig(kFaults), "lamps", std::string(kDmxLamps) + kFaults),
           kTwiceEightLamps, 4, 0.001);
}

TEST(WireVmHidFaults, AreRetakenOrPause) {
  Campaign(DirectRig(),
           WithTable(RealTime(DirectRig()), "projector", Dlpc350("PROJECTOR2", kFaults)), k4d, 4,
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

// What the camera keeps is known here: no frame that is stamped later counts.
TEST(WireVmUvc, WithALatencyALightStageEqualsTheDirectOneToo) {
  const std::string rig = Replaced(UvcRig(RealTime(UvcDirectRig()), "latency_ms = 50\n"),
                                   "frames_per_s = 20\n", "frames_per_s = 20\nlatency_ms = 250\n");
  ExpectSame(TestFolder(), UvcDirectRig(), rig, kTwiceEightLamps, 16, 0.016);
}

// The calibration knows nothing of the latency that the camera has. What the kernel's stamps add to it in so slow a machine nobody knows.
TEST(WireVmUvc, TheLatencyIsMeasured) {
  TestFolder folder;
  WriteText(folder / "white.toml",
            "turntable = false\n[material.white]\ndiffuse = [0.8, 0.8, 0.8]\n"
            "[[box]]\ncenter_m = [0, 0, -0.01]\nsize_m = [4, 4, 0.02]\nmaterial = \"white\"\n");
  std::string rig = Replaced(UvcRig(RealTime(UvcDirectRig()), "latency_ms = 30\n"),
                             "scene = \"balls\"", "scene = \"white.toml\"");
  rig = Replaced(rig, "exposures_us = [1000, 16000]", "exposures_us = [16000]");
  // Mostly idle: where the machine is busy with the pictures, the light is switched between them only.
  rig = Replaced(rig, "frames_per_s = 20", "frames_per_s = 5");
  WriteText(folder / "rig.toml",
            Replaced(rig, "[engine]", "[limits]\nmax_lamps_on = 2\n\n[engine]"));
  Process daemon({DaemonProgram(), "--rig", folder / "rig.toml", "--data", folder / "data",
                  "--calibrate-latency"},
                 folder / "lightstaged");
  ASSERT_EQ(daemon.Wait(Milliseconds(300000)), 0) << daemon.err();
  const std::string found = daemon.out();
  const std::string key = "\nlatency_ms = ";
  ASSERT_NE(found.find(key), std::string::npos) << found;
  const double latency_ms = std::stod(found.substr(found.find(key) + key.size()));
  EXPECT_GE(latency_ms, 30) << found;
  std::cout << found;
}

TEST(WireVmUvc, FaultsAreRetakenOrPause) {
  Campaign(UvcDirectRig(),
           UvcRig(RealTime(UvcDirectRig()), "fault_interval_s = 2\nfault_after_s = 3\n"),
           kSixteenLamps, 8);
}

}  // namespace
}  // namespace lightstage
