// The contracts of axes and lamps, kept by the driver over simulated nodes.
#include "drivers/conformance/fixtures.h"
#include "sim/peers/canopen/test_bench.h"

namespace lightstage::sim {
namespace {

struct TurntableFixture : AxisFixture {
  Clock& clock() override { return bench.clock(); }
  absl::StatusOr<std::unique_ptr<Axis>> Open() override {
    bench.AddDrive();
    return bench.OpenAxis(std::string(kPatient) + kTurntable);
  }
  TestBench bench;
};

// What the other is not: limited, counting against the rig's sense, watched by SDO, stopped by quick stop.
struct TiltFixture : AxisFixture {
  Clock& clock() override { return bench.clock(); }
  absl::StatusOr<std::unique_ptr<Axis>> Open() override {
    bench.AddDrive({.role = AxisRole::kTilt,
                    .units_per_turn = -8000,
                    .home_deg = 5,
                    .software_limits = {{-2000, 0}},
                    .has_abort_option = false,
                    .has_pdo = false});
    return bench.OpenAxis(
        std::string(kPatient) +
        "node = 5\nmin_deg = 5\nmax_deg = 90\nzero_deg = 5\nunits_per_turn = -8000\n"
        "max_velocity_dps = 200\nmax_acceleration_dps2 = 2000\ntolerance_deg = 0.05\n"
        "homing_method = 17\nhoming_velocity_dps = 200\npoll_ms = 5\nsetpoint_ms = 1000\n"
        "stop = \"quick-stop\"\n");
  }
  TestBench bench;
};

struct OutputsFixture : LampsFixture {
  OutputsFixture(OutputModuleOptions module, std::string toml)
      : module_(std::move(module)), toml_(std::move(toml)) {}
  Clock& clock() override { return bench.clock(); }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() override {
    bench.AddOutputs(module_);
    return bench.OpenLamps(kPatient + toml_);
  }
  std::optional<std::vector<float>> Emitted() override { return bench.Light(); }
  TestBench bench;

 private:
  const OutputModuleOptions module_;
  const std::string toml_;
};

[[maybe_unused]] const bool kRegistered =
    RegisterAxisConformance("CanopenTurntable",
                            [] { return std::make_unique<TurntableFixture>(); }) &&
    RegisterAxisConformance("CanopenTilt", [] { return std::make_unique<TiltFixture>(); }) &&
    // Three lamps across two groups of eight.
    RegisterLampsConformance("CanopenDigital",
                             [] {
                               return std::make_unique<OutputsFixture>(
                                   OutputModuleOptions{.first_output = 6},
                                   std::string(kDigitalLamps) + "first_output = 6\n");
                             }) &&
    RegisterLampsConformance("CanopenAnalogue", [] {
      return std::make_unique<OutputsFixture>(OutputModuleOptions{.analogue = true, .outputs = 4},
                                              "node = 9\noutput = \"analogue\"\nsettle_ms = 1\n");
    });

}  // namespace
}  // namespace lightstage::sim
