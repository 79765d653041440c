#include "drivers/conformance/null_devices.h"

#include <gtest/gtest.h>

#include "drivers/conformance/fixtures.h"

namespace lightstage {
namespace {

class NullCameraFixture : public CameraFixture {
 public:
  Clock& clock() override { return clock_; }
  absl::StatusOr<std::unique_ptr<Camera>> Open() override {
    return std::make_unique<NullCamera>(clock_, 6, 4);
  }

 private:
  VirtualClock clock_;
};

class NullAxisFixture : public AxisFixture {
 public:
  explicit NullAxisFixture(bool continuous) : continuous_(continuous) {}
  Clock& clock() override { return clock_; }
  absl::StatusOr<std::unique_ptr<Axis>> Open() override {
    AxisInfo info;
    info.identity = {"axis", "null", "null", ""};
    info.continuous = continuous_;
    info.min = Degrees(-10);
    info.max = Degrees(90);
    info.max_velocity_dps = 30;
    info.max_acceleration_dps2 = 60;
    return std::make_unique<NullAxis>(info);
  }

 private:
  const bool continuous_;
  VirtualClock clock_;
};

class NullLampsFixture : public LampsFixture {
 public:
  Clock& clock() override { return clock_; }
  absl::StatusOr<std::unique_ptr<Lamps>> Open() override { return std::make_unique<NullLamps>(5); }

 private:
  VirtualClock clock_;
};

class NullProjectorFixture : public ProjectorFixture {
 public:
  Clock& clock() override { return clock_; }
  absl::StatusOr<std::unique_ptr<Projector>> Open() override {
    return std::make_unique<NullProjector>(64, 48);
  }

 private:
  VirtualClock clock_;
};

[[maybe_unused]] const bool kCamera =
    RegisterCameraConformance("Null", [] { return std::make_unique<NullCameraFixture>(); });
[[maybe_unused]] const bool kAxis =
    RegisterAxisConformance("Null", [] { return std::make_unique<NullAxisFixture>(false); });
[[maybe_unused]] const bool kTurntable = RegisterAxisConformance(
    "NullContinuous", [] { return std::make_unique<NullAxisFixture>(true); });
[[maybe_unused]] const bool kLamps =
    RegisterLampsConformance("Null", [] { return std::make_unique<NullLampsFixture>(); });
[[maybe_unused]] const bool kProjector =
    RegisterProjectorConformance("Null", [] { return std::make_unique<NullProjectorFixture>(); });

// What the engine's benchmark relies on: no operation outlives its call.
TEST(NullDevices, CompleteBeforeTheCallReturns) {
  VirtualClock clock;
  NullCamera camera(clock, 1, 1);
  int calls = 0;
  auto count = [&calls](const auto& result) { calls += result.ok(); };
  camera.Arm(kNever, count);
  camera.Trigger(std::chrono::milliseconds(5), kNever, count, count);
  EXPECT_EQ(calls, 3);
  EXPECT_EQ(clock.Now(), TimePoint{});
}

}  // namespace
}  // namespace lightstage
