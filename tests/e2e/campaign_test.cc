// Faults on every wire, at random moments: each shot is retaken, or the run pauses dark with a reason that names the device; what is stored in the
// end is what an undisturbed capture stores. How many: LIGHTSTAGE_CAMPAIGN_FAULTS per rig, default 12; seed: LIGHTSTAGE_CAMPAIGN_SEED.
#include <cstdlib>
#include <map>
#include <string>

#include "gtest/gtest.h"
#include "tests/harness/compare.h"

namespace lightstage {
namespace {

int FromEnvironment(const char* name, int fallback) {
  const char* value = std::getenv(name);
  return value != nullptr ? std::atoi(value) : fallback;
}

size_t Count(const std::string& text, const std::string& what) {
  size_t count = 0;
  for (size_t at = 0; (at = text.find(what, at)) != std::string::npos; ++at) ++count;
  return count;
}

// `rig` with the table `name` replaced by `keys`, and a fault now and then; `wire`: more keys of its peer.
std::string Faulty(const std::string& rig, const std::string& name, const std::string& keys,
                   const std::string& wire = "") {
  return WithTable(
      rig, name,
      keys + "[" + name + ".peer]\nfault_interval_s = 0.7\nfault_after_s = 1.5\nfault_seed = " +
          std::to_string(FromEnvironment("LIGHTSTAGE_CAMPAIGN_SEED", 1)) + "\n" + wire);
}

constexpr char kProcess[] = "wire = \"process\"\n";
constexpr char kServo[] =
    "max_velocity_dps = 720\nmax_acceleration_dps2 = 7200\nsettle_ms = 10\npoll_ms = 5\n";

std::string ModbusTable(const std::string& rig) {
  return Faulty(rig, "turntable",
                std::string("driver = \"sim-modbus\"\nprofile = \"oriental-motor-az\"\n"
                            "continuous = true\nhost = \"127.0.0.1\"\nport = 502\n"
                            "steps_per_degree = 1000\n") +
                    kServo);
}
std::string CanopenTable(const std::string& rig) {
  return Faulty(rig, "turntable",
                std::string("driver = \"sim-canopen\"\ninterface = \"can0\"\nnode = 5\n"
                            "continuous = true\nunits_per_turn = 36000\nhoming_method = 19\n"
                            "homing_velocity_dps = 360\n") +
                    kServo,
                kProcess);
}
std::string GigeCamera(const std::string& rig) {
  return Faulty(WithTable(rig, "camera",
                          "driver = \"sim-gige\"\nformat = \"BayerRG16\"\nwidth = 64\n"
                          "height = 48\nexposures_us = [1000, 16000]\n"),
                "camera.options",
                "address = \"127.0.0.1\"\ngain_db_per_step = 1.0\npacket_size = 1400\n",
                "sensor_width = 64\nsensor_height = 48\nbits = 12\n");
}

// Captures the plan with the faulty rig again and again until there were enough faults.
void Campaign(const std::string& small, const std::string& faulty,
              const std::vector<std::string>& plan) {
  const size_t wanted = static_cast<size_t>(FromEnvironment("LIGHTSTAGE_CAMPAIGN_FAULTS", 12));
  TestFolder direct_folder;
  Daemon direct(direct_folder, small);
  const std::string direct_run = direct.Capture(plan);
  TestFolder folder;
  Daemon daemon(folder, faulty);
  int runs = 0, images = 0, retakes = 0;
  double worst = 0;
  std::map<std::string, int> pauses;  // by reason
  std::vector<std::string> capture = {"capture", "--detach"};
  capture.insert(capture.end(), plan.begin(), plan.end());
  while (Count(daemon.log(), "fault on purpose") < wanted) {
    // A fault may have come since the last run's end.
    Answer started;
    ASSERT_TRUE(WaitUntil(Milliseconds(60000), [&] {
      started = daemon.Ctl({"reset"});
      if (started.code == 0) started = daemon.Ctl(capture);
      return started.code == 0;
    })) << started.err;
    const std::string run = started.json()["run"]["name"];
    Json now;
    for (bool ended = false; !ended;) {
      ASSERT_TRUE(WaitUntil(Milliseconds(120000), [&] {
        now = daemon.Run(run);
        return now["state"] == "RUN_STATE_PAUSED" || now["state"] == "RUN_STATE_SUCCEEDED";
      })) << now.dump(1);
      ended = now["state"] == "RUN_STATE_SUCCEEDED";
      if (ended) break;
      ++pauses[now["reason"].value("reason", "")];
      const std::string message = now["reason"].value("message", "");
      bool named = false;
      for (const char* device : {"camera", "turntable", "tilt", "lamps", "projector"}) {
        named |= message.find(device) != std::string::npos;
      }
      EXPECT_TRUE(named) << "names no device: " << now["reason"].dump();
      // A fault may come in between again.
      Answer last;
      ASSERT_TRUE(WaitUntil(Milliseconds(60000), [&] {
        last = daemon.Ctl({"reset"});
        if (last.code == 0) last = daemon.Ctl({"runs", "resume", run});
        return last.code == 0;
      })) << last.err;
    }
    retakes += now.value("retakes", 0);
    const BasisComparison same = CompareBasis(direct, direct_run, daemon, run, 12, 0.016);
    ++runs;
    images += same.images;
    worst = std::max(worst, same.worst);
    EXPECT_LE(same.worst, 1.0) << same.where << " of run " << runs;
    EXPECT_EQ(daemon.Ctl({"runs", "verify", run}).code, 0);
  }
  const std::string log = daemon.log();
  std::printf(
      "%zu faults in %d runs: %d images, %d retakes, worst difference %.3f of a code; pauses:",
      Count(log, "fault on purpose"), runs, images, retakes, worst);
  for (const auto& [reason, count] : pauses) std::printf(" %d %s", count, reason.c_str());
  std::printf("\n");
  EXPECT_EQ(daemon.Terminate(), 0);
}

std::string Small() {
  return Replaced(WithoutNoise(SmallRig()), "format = \"RGB16\"", "format = \"BayerRG16\"");
}

TEST(Campaign, ModbusAxisAndLamps) {
  Campaign(Small(),
           Faulty(ModbusTable(RealTime(Small())), "lamps",
                  "driver = \"sim-modbus\"\nkind = \"coils\"\ncount = 40\nsettle_ms = 2\n"
                  "host = \"127.0.0.1\"\nport = 503\n"),
           {"light-stage", "--azimuths", "2"});
}

TEST(Campaign, CanopenAxisAndLamps) {
  Campaign(Small(),
           Faulty(CanopenTable(RealTime(Small())), "lamps",
                  "driver = \"sim-canopen\"\ninterface = \"can0\"\nnode = 9\n"
                  "output = \"digital\"\nsettle_ms = 2\n",
                  kProcess),
           {"light-stage", "--azimuths", "2"});
}

TEST(Campaign, DmxLampsAndGigECamera) {
  Campaign(Small(),
           Faulty(GigeCamera(RealTime(Small())), "lamps",
                  "driver = \"sim-dmx\"\nwidget = \"open\"\nserial = \"LAMPS1\"\nslots = 40\n"
                  "first_channel = 1\nlamp_count = 40\nsettle_ms = 2\n",
                  kProcess),
           {"light-stage", "--azimuths", "2"});
}

TEST(Campaign, Dlpc350Projector) {
  const std::string small =
      Replaced(Small(), "width = 256\nheight = 192", "width = 912\nheight = 1140");
  Campaign(small,
           Faulty(RealTime(small), "projector",
                  "driver = \"sim-dlpc350\"\nserial = \"PROJECTOR1\"\nmode = \"flash\"\n"
                  "led_current = [100, 100, 100]\nled_current_limit = 150\n"
                  "[[projector.patterns]]\narrangement = \"square\"\ngrid = 8\n"
                  "every_square = true\nimage = 0\ndepth = 1\n",
                  kProcess),
           {"projector-4d", "--azimuths", "1", "--tilts", "20,50", "--grid", "8"});
}

TEST(Campaign, DisplayProjector) {
  Campaign(Small(),
           Faulty(RealTime(Small()), "projector",
                  "driver = \"sim-display\"\nx_display = \":6873\"\noutput = \"screen\"\n"
                  "renderer = \"software\"\n"),
           {"projector-4d", "--azimuths", "1", "--tilts", "20,50", "--grid", "4"});
}

}  // namespace
}  // namespace lightstage
