// The axis contract over every drive that has a profile, on TCP and on a serial line.
#include <gtest/gtest.h>

#include "drivers/conformance/fixtures.h"
#include "drivers/conformance/private_network.h"
#include "sim/peers/modbus/test_bench.h"

namespace lightstage::sim {
namespace {

[[maybe_unused]] const bool kPrivateNetwork = EnterPrivateNetwork();

constexpr char kBounded[] = "min_deg = -20\nmax_deg = 90\n", kTurning[] = "continuous = true\n";

class DriveFixture : public AxisFixture {
 public:
  DriveFixture(std::string kind, Wire wire, std::string keys, double steps_per_rev)
      : kind_(std::move(kind)), wire_(wire), keys_(std::move(keys)) {
    options_.kind = kind_;
    options_.steps_per_rev = steps_per_rev;
  }
  Clock& clock() override { return bench_.clock(); }
  absl::StatusOr<std::unique_ptr<Axis>> Open() override {
    ASSIGN_OR_RETURN(auto drive, ModbusDrivePeer::Create(options_, bench_.world()));
    RETURN_IF_ERROR(bench_.Serve(wire_, {{5, drive}}));
    return bench_.Open(ModbusAxisDriver(), "turntable",
                       absl::StrCat("unit = 5\nprofile = \"", kind_,
                                    "\"\nsteps_per_degree = 1000\nmax_velocity_dps = 400\n"
                                    "max_acceleration_dps2 = 4000\nsettle_ms = 10\npoll_ms = 2\n"
                                    "response_timeout_ms = 1000\ntolerance_deg = 0.005\n",
                                    keys_));
  }

 private:
  ModbusBench bench_;
  const std::string kind_;
  const Wire wire_;
  const std::string keys_;
  DrivePeerOptions options_;
};

bool Register(const char* name, const char* kind, Wire wire, const char* keys,
              double steps_per_rev = 10000) {
  return RegisterAxisConformance(
      name, [=] { return std::make_unique<DriveFixture>(kind, wire, keys, steps_per_rev); });
}

[[maybe_unused]] const bool kConformance =
    Register("OrientalMotorTcp", "oriental-motor-az", Wire::kTcp, kBounded) &&
    Register("OrientalMotorRtuTurning", "oriental-motor-az", Wire::kRtu, kTurning) &&
    Register("LeadshineRtu", "leadshine-rs", Wire::kRtu, kBounded) &&
    Register("AppliedMotionTcpTurning", "applied-motion", Wire::kTcp, kTurning, 20000) &&
    Register("AppliedMotionRtu", "applied-motion", Wire::kRtu, kBounded, 20000) &&
    Register("GenericTcp", "generic", Wire::kTcp,
             "reverse = true\nmin_deg = -90\nmax_deg = 20\n") &&
    Register("LowWordFirstRtuTurning", "generic-low-word-first", Wire::kRtu, kTurning);

}  // namespace
}  // namespace lightstage::sim
