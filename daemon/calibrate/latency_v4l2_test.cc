// The v4l2 driver in real time, with a camera that runs in this process and whose latency only it knows.
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include "daemon/calibrate/latency.h"
#include "daemon/calibrate/test_lamps.h"
#include "daemon/rig/testing/null_rig.h"
#include "drivers/v4l2/fake_system.h"
#include "drivers/v4l2/v4l2_camera.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;

struct Setup {
  double frames_per_s;
  Duration readout, transport;
  FakeStamp stamp;
  std::optional<Duration> latency;  // that the rig file has already
  Duration exposure;
};

// What the driver needs: from the end of the first row's exposure to the stamp.
void Expect(const Setup& setup, Duration truth) {
  RealClock clock;
  FakeSetup fake;
  fake.formats = {{V4L2_PIX_FMT_GREY, {{32, 24}}}};
  fake.controls = {{V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 1, 5000, 1, 100}};
  fake.readout = setup.readout;
  fake.transport = setup.transport;
  fake.stamp = setup.stamp;
  FakeCamera world(fake);
  FakeVideoSystem system;
  system.Add("/dev/video0", &world);
  V4l2Options options;
  options.card = "Test camera";
  options.frames_per_s = setup.frames_per_s;
  options.latency = setup.latency;
  auto camera = V4l2Camera::Open(system, options, {"camera", &clock, nullptr});
  ASSERT_TRUE(camera.ok()) << camera.status();

  auto file = NullRigFile(clock);
  file->projector = {};
  file->camera_options.config = {PixelFormat::kMono8, 32, 24, 0};
  file->camera_options.exposures = {setup.exposure};
  file->engine.device_timeout = std::chrono::seconds(5);
  file->camera = TableOf<Camera>(*std::move(camera));
  file->lamps = TableOf<Lamps>(std::make_unique<TestLamps>(
      clock, milliseconds(1), milliseconds(2), [&world](double level) { world.SetLight(level); }));
  auto rig = Rig::Open(*file, clock);
  ASSERT_TRUE(rig.ok()) << rig.status();
  const auto report = MeasureLatency(**rig, [] { return false; });
  ASSERT_TRUE(report.ok()) << report.status();
  const std::string found = LatencyToml(*report);
  EXPECT_GE(report->latency(), truth) << found;
  EXPECT_GE(report->without_light, truth) << found;
  // A frame more, and the time of the light, which a busy machine makes longer.
  EXPECT_LE(report->latency(), truth + 4 * report->margin + report->light_time) << found;
  testing::Test::RecordProperty("truth_ms", std::to_string(Seconds(truth) * 1e3));
  testing::Test::RecordProperty("found", found);
}

TEST(LatencyV4l2, AtAHundredFramesASecond) {
  Expect({100, milliseconds(3), milliseconds(2), FakeStamp::kEndOfFrame, {}, milliseconds(2)},
         milliseconds(5));
}

// What the rig file says already makes no difference, also if it is too short.
TEST(LatencyV4l2, LongerThanTwoFramesAtFifty) {
  Expect({50, milliseconds(14), milliseconds(30), FakeStamp::kEndOfFrame, milliseconds(0),
          milliseconds(8)},
         milliseconds(44));
}

TEST(LatencyV4l2, StampedAtItsFirstPacketAtForty) {
  Expect({40, milliseconds(20), milliseconds(9), FakeStamp::kFirstPacket, {}, milliseconds(16)},
         milliseconds(9));
}

// A stamp that is not believed leaves the moment when the frame was there.
TEST(LatencyV4l2, WithoutABelievedStamp) {
  Expect({100, milliseconds(4), milliseconds(3), FakeStamp::kFuture, {}, milliseconds(3)},
         milliseconds(7));
}

}  // namespace
}  // namespace lightstage
