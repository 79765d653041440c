// Faults on every wire that every machine has, or can have within the process. How many: LIGHTSTAGE_CAMPAIGN_FAULTS per rig, default 12; seed:
// LIGHTSTAGE_CAMPAIGN_SEED.
#include "tests/harness/campaign.h"

#include <cstdlib>
#include <string>

#include "gtest/gtest.h"
#include "tests/harness/compare.h"

namespace lightstage {
namespace {

int FromEnvironment(const char* name, int fallback) {
  const char* value = std::getenv(name);
  return value != nullptr ? std::atoi(value) : fallback;
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
  return Faulty(WithTable(rig, "camera", SimGige("BayerRG16", "1000, 16000")), "camera.options",
                SimGigeOptions(1400), kSimGigePeer);
}

size_t Faults() { return static_cast<size_t>(FromEnvironment("LIGHTSTAGE_CAMPAIGN_FAULTS", 12)); }

std::string Small() {
  return Replaced(WithoutNoise(SmallRig()), "format = \"RGB16\"", "format = \"BayerRG16\"");
}

// The axis by TCP, the lamps on a serial line.
TEST(Campaign, ModbusAxisAndLamps) {
  Campaign(Small(),
           Faulty(ModbusTable(RealTime(Small())), "lamps",
                  "driver = \"sim-modbus\"\nkind = \"coils\"\ncount = 40\nsettle_ms = 2\n"
                  "baud = 115200\nparity = \"none\"\nserial_port = \"" +
                      testing::TempDir() + "lamps-" + std::to_string(getpid()) + "\"\n"),
           {"light-stage", "--azimuths", "2"}, Faults());
}

TEST(Campaign, CanopenAxisAndLamps) {
  Campaign(Small(),
           Faulty(CanopenTable(RealTime(Small())), "lamps",
                  "driver = \"sim-canopen\"\ninterface = \"can0\"\nnode = 9\n"
                  "output = \"digital\"\nsettle_ms = 2\n",
                  kProcess),
           {"light-stage", "--azimuths", "2"}, Faults());
}

// Frames long enough for a widget to be unplugged in the middle of one.
std::string DmxLamps(const std::string& rig, const std::string& widget) {
  return Faulty(rig, "lamps",
                "driver = \"sim-dmx\"\nwidget = \"" + widget +
                    "\"\nserial = \"LAMPS1\"\nslots = 120\n"
                    "first_channel = 1\nlamp_count = 40\nsettle_ms = 2\n",
                kProcess);
}

TEST(Campaign, DmxLampsAndGigECamera) {
  Campaign(Small(), DmxLamps(GigeCamera(RealTime(Small())), "open"),
           {"light-stage", "--azimuths", "2"}, Faults());
}

TEST(Campaign, DmxProLamps) {
  Campaign(Small(), DmxLamps(RealTime(Small()), "pro"), {"light-stage", "--azimuths", "2"},
           Faults());
}

// `mode` and what belongs to it.
void Dlpc350Campaign(const std::string& mode, const std::string& grid) {
  const std::string small = WithMirrors(Small());
  Campaign(small,
           Faulty(RealTime(small), "projector",
                  "driver = \"sim-dlpc350\"\nserial = \"PROJECTOR1\"\n"
                  "led_current = [100, 100, 100]\nled_current_limit = 150\n" +
                      mode,
                  kProcess),
           {"projector-4d", "--azimuths", "1", "--tilts", "20,50", "--grid", grid}, Faults());
}

TEST(Campaign, Dlpc350Projector) {
  Dlpc350Campaign(
      "mode = \"flash\"\n[[projector.patterns]]\narrangement = \"square\"\ngrid = 8\n"
      "every_square = true\nimage = 0\ndepth = 1\n",
      "8");
}

TEST(Campaign, Dlpc350ProjectorWithVideo) {
  Dlpc350Campaign("mode = \"video\"\n[projector.display]\n" + SimDisplayOutput() +
                      "[projector.display.peer]\nfault_interval_s = 3\nfault_after_s = 2\n",
                  "4");
}

TEST(Campaign, DisplayProjector) {
  Campaign(Small(), Faulty(RealTime(Small()), "projector", SimDisplay()),
           {"projector-4d", "--azimuths", "1", "--tilts", "20,50", "--grid", "4"}, Faults());
}

}  // namespace
}  // namespace lightstage
