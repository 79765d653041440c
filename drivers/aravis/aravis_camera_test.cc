// The driver against Aravis' own fake camera, over real GVCP and GVSP on a loopback of this process' own.
#include "drivers/aravis/aravis_camera.h"

#include <arv.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <optional>
#include <sstream>

#include "drivers/aravis/driver.h"
#include "drivers/aravis/fake_camera_process.h"
#include "drivers/conformance/fixtures.h"
#include "drivers/conformance/private_network.h"
#include "drivers/conformance/unplug.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

[[maybe_unused]] const bool kPrivateNetwork = EnterPrivateNetwork();

AravisOptions Options() {
  AravisOptions options;
  options.address = FakeCameraProcess::kAddress;
  options.packet_size = 7000;
  options.frame_retention = milliseconds(60);
  options.lost_after = seconds(10);  // a busy machine must not make the camera seem lost
  return options;
}

// ---- Conformance

class AravisFixture : public CameraFixture {
 public:
  explicit AravisFixture(std::optional<Duration> margin) : margin_(margin) {}
  Clock& clock() override { return clock_; }
  absl::StatusOr<std::unique_ptr<Camera>> Open() override {
    ASSIGN_OR_RETURN(FakeCameraProcess process, FakeCameraProcess::Start("CONFORM"));
    process_.emplace(std::move(process));
    AravisOptions options = Options();
    options.exposure_end_margin = margin_;
    return AravisCamera::Open(options, {"camera", &clock_, nullptr});
  }
  CameraConfig config(const CameraInfo& info) const override {
    return {info.formats.front(), 160, 120, info.min_gain_db};
  }
  // Plain UDP may lose a packet when the machine is busy, and this peer sends none twice.
  int retakes() const override { return 5; }

 private:
  const std::optional<Duration> margin_;
  RealClock clock_;
  std::optional<FakeCameraProcess> process_;
};

[[maybe_unused]] const bool kConformance = RegisterCameraConformance(
    "Aravis", [] { return std::make_unique<AravisFixture>(std::nullopt); });
[[maybe_unused]] const bool kConformanceWithMargin = RegisterCameraConformance(
    "AravisWithMargin", [] { return std::make_unique<AravisFixture>(milliseconds(1)); });

// ---- What only this driver has

constexpr CameraConfig kSmall{PixelFormat::kMono8, 160, 120, 0};

class AravisCameraTest : public testing::Test {
 protected:
  void Start(int lost_per_mille = 0) {
    process_.reset();
    absl::StatusOr<FakeCameraProcess> process = FakeCameraProcess::Start("GV42", lost_per_mille);
    ASSERT_TRUE(process.ok()) << process.status();
    process_.emplace(*std::move(process));
  }
  absl::Status Open(const AravisOptions& options) {
    camera_.reset();
    ASSIGN_OR_RETURN(camera_, AravisCamera::Open(options, {"camera", &clock_, nullptr}));
    return absl::OkStatus();
  }
  template <class Call>
  absl::StatusOr<CameraConfig> Do(Call call) {
    Pending<CameraConfig> done(clock_);
    call(clock_.Now() + seconds(30), done.sink());
    return done.Wait(clock_.Now() + seconds(60), "the operation");
  }
  absl::Status Ready(const CameraConfig& config) {
    RETURN_IF_ERROR(Do([&](TimePoint deadline, Completion<CameraConfig> done) {
                      camera_->Configure(config, deadline, std::move(done));
                    }).status());
    return Do([&](TimePoint deadline, Completion<CameraConfig> done) {
             camera_->Arm(deadline, std::move(done));
           })
        .status();
  }
  absl::StatusOr<Frame> Take(Duration exposure, Duration patience = seconds(20)) {
    Pending<ExposureEnd> ended(clock_);
    Pending<Frame> frame(clock_);
    camera_->Trigger(exposure, clock_.Now() + patience, ended.sink(), frame.sink());
    return frame.Wait(clock_.Now() + patience + seconds(30), "the frame");
  }
  absl::StatusOr<Frame> TakeWithRetakes(Duration exposure) {
    absl::StatusOr<Frame> frame = Take(exposure);
    for (int i = 0; i < 5 && absl::IsDataLoss(frame.status()); ++i) frame = Take(exposure);
    return frame;
  }
  // With the patience of a rig file that is silent about it.
  void ExpectUnplugging(absl::FunctionRef<void(bool plugged)> plug) {
    Start();
    AravisOptions options = Options();
    options.lost_after = AravisOptions().lost_after;
    ASSERT_TRUE(Open(options).ok());
    ASSERT_TRUE(Ready(kSmall).ok());
    CheckUnplugging(clock_, "camera",
                    {.plug = plug,
                     .use = [&] { return TakeWithRetakes(milliseconds(10)).status(); },
                     .recover =
                         [&] {
                           camera_->Disarm(clock_.Now() + seconds(30), [](auto) {});
                           return Ready(kSmall);
                         }});
  }

  RealClock clock_;
  std::optional<FakeCameraProcess> process_;
  std::unique_ptr<Camera> camera_;
};

// What is logged while it lives.
class Log {
 public:
  Log() : before_(spdlog::default_logger()) {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>(
        "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(text_)));
  }
  ~Log() { spdlog::set_default_logger(before_); }
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  const std::shared_ptr<spdlog::logger> before_;
};

// The fake camera's picture: a diagonal ramp (x + y + frame id) mod 255 at 10 ms and gain 0.
bool IsDiagonalRamp(const Frame& frame) {
  int base = static_cast<int>(frame.data[0]);
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      int value = static_cast<int>(frame.data[static_cast<size_t>(y) * frame.width + x]);
      if (value != (base + x + y) % 255) return false;
    }
  }
  return true;
}

TEST_F(AravisCameraTest, TellsWhatTheCameraIs) {
  Start();
  ASSERT_TRUE(Open(Options()).ok());
  const CameraInfo& info = camera_->info();
  EXPECT_EQ(info.identity.name, "camera");
  EXPECT_EQ(info.identity.driver, "aravis");
  EXPECT_EQ(info.identity.model, "Aravis Fake");
  EXPECT_EQ(info.identity.serial, "GV42");
  EXPECT_EQ(info.sensor_width, 2048);
  EXPECT_EQ(info.min_exposure, std::chrono::microseconds(10));
  EXPECT_EQ(info.max_exposure, seconds(10));
}

TEST_F(AravisCameraTest, DeliversTheCamerasPicture) {
  Start();
  ASSERT_TRUE(Open(Options()).ok());
  ASSERT_TRUE(Ready(kSmall).ok());
  absl::StatusOr<Frame> frame = TakeWithRetakes(milliseconds(10));
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_TRUE(IsDiagonalRamp(*frame));
  EXPECT_GT(frame->device_timestamp_ns, 0);
}

TEST_F(AravisCameraTest, IsFoundBySerial) {
  Start();
  AravisOptions options = Options();
  options.address.clear();
  options.serial = "GV42";
  absl::Status opened = Open(options);
  EXPECT_TRUE(opened.ok()) << opened;
  options.serial = "GV43";
  opened = Open(options);
  EXPECT_EQ(ErrorReason(opened), "DEVICE_NOT_FOUND") << opened;
  EXPECT_NE(opened.message().find("GV43"), std::string_view::npos) << opened;
}

TEST_F(AravisCameraTest, IsDiscoveredWithLinesThatOpenIt) {
  Start();
  const absl::StatusOr<std::vector<Discovered>> found = AravisDiscovery()();
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 1u);
  EXPECT_EQ(found->front().what, "GigEVision camera Aravis Fake, serial GV42, at 127.0.0.1");
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse(found->front().toml, "found.toml");
  ASSERT_TRUE(document.ok()) << document.status();
  const TomlTable table = document->root().Table("camera");
  EXPECT_EQ(table.String("driver"), "aravis");
  DeviceOpener<Camera> open = AravisDriver().parse(table.Table("options"));
  ASSERT_TRUE(document->Finish().ok()) << document->Finish();
  const absl::StatusOr<std::unique_ptr<Camera>> camera = open({"camera", &clock_, nullptr});
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ((*camera)->info().identity.serial, "GV42");
}

TEST_F(AravisCameraTest, AnotherSerialAtTheAddressIsRefused) {
  Start();
  AravisOptions options = Options();
  options.serial = "GV43";
  absl::Status opened = Open(options);
  EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE") << opened;
  EXPECT_NE(opened.message().find("GV42"), std::string_view::npos) << opened;
}

TEST_F(AravisCameraTest, NobodyAtTheAddressIsAClearErrorWithinTenSeconds) {
  TimePoint before = clock_.Now();
  absl::Status opened = Open(Options());
  EXPECT_EQ(opened.code(), absl::StatusCode::kNotFound) << opened;
  EXPECT_EQ(ErrorReason(opened), "DEVICE_NOT_FOUND");
  EXPECT_NE(opened.message().find("127.0.0.1"), std::string_view::npos) << opened;
  EXPECT_LT(clock_.Now() - before, seconds(10));
}

TEST_F(AravisCameraTest, VirtualTimeIsRefused) {
  VirtualClock clock;
  absl::Status opened = AravisCamera::Open(Options(), {"camera", &clock, nullptr}).status();
  EXPECT_EQ(opened.code(), absl::StatusCode::kFailedPrecondition) << opened;
}

// Lost packets make frames fail, never wrong; and the camera stays usable.
TEST_F(AravisCameraTest, StreamsThatLosePacketsAreToldInTheLog) {
  Log log;
  Start(/*lost_per_mille=*/100);
  ASSERT_TRUE(Open(Options()).ok());
  absl::Status ready = Ready(kSmall);
  ASSERT_TRUE(ready.ok()) << ready;
  for (int i = 0; i < 200; ++i) {
    absl::StatusOr<Frame> frame = Take(milliseconds(10), seconds(1));
    if (ErrorReason(frame.status()) == "FRAME_INCOMPLETE") break;
  }
  camera_.reset();
  EXPECT_NE(log.text().find("camera: the stream loses data: "), std::string::npos) << log.text();
  EXPECT_NE(log.text().find("camera: the stream ends: "), std::string::npos) << log.text();
}

TEST_F(AravisCameraTest, LostPacketsAreRetakeableErrorsNeverBadFrames) {
  Start(/*lost_per_mille=*/40);
  ASSERT_TRUE(Open(Options()).ok());
  absl::Status ready = Ready(kSmall);
  ASSERT_TRUE(ready.ok()) << ready;
  int good = 0, lost = 0;
  for (int i = 0; i < 200 && (good < 5 || lost < 3); ++i) {
    absl::StatusOr<Frame> frame = Take(milliseconds(10), seconds(1));
    if (frame.ok()) {
      ++good;
      EXPECT_TRUE(IsDiagonalRamp(*frame));
      continue;
    }
    ++lost;
    // If every packet was lost nobody knows of the frame.
    bool whole = absl::IsDeadlineExceeded(frame.status());
    EXPECT_EQ(ErrorReason(frame.status()), whole ? "DEVICE_SILENT" : "FRAME_INCOMPLETE")
        << frame.status();
  }
  EXPECT_GE(good, 5);
  EXPECT_GE(lost, 3);
}

// What a frozen camera costs is the deadline; its late frame is not taken for the next one.
TEST_F(AravisCameraTest, FrozenCameraMissesTheDeadlineAndRecovers) {
  Start();
  ASSERT_TRUE(Open(Options()).ok());
  ASSERT_TRUE(Ready(kSmall).ok());
  absl::StatusOr<Frame> before = TakeWithRetakes(milliseconds(10));
  ASSERT_TRUE(before.ok()) << before.status();
  process_->Suspend(true);
  TimePoint start = clock_.Now();
  absl::StatusOr<Frame> frozen = Take(milliseconds(20), milliseconds(300));
  EXPECT_EQ(frozen.status().code(), absl::StatusCode::kDeadlineExceeded) << frozen.status();
  EXPECT_EQ(ErrorReason(frozen.status()), "DEVICE_SILENT");
  EXPECT_GE(clock_.Now() - start, milliseconds(300));
  EXPECT_LT(clock_.Now() - start, seconds(5));
  process_->Suspend(false);
  absl::StatusOr<Frame> after = TakeWithRetakes(milliseconds(10));
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(after->exposure, milliseconds(10));
  EXPECT_GT(after->sequence, before->sequence);
  EXPECT_TRUE(IsDiagonalRamp(*after));  // at 20 ms the ramp would be steeper
}

// Unplugged while armed: triggers fail by their deadline, then with DEVICE_LOST; Configure connects anew once it is back.
TEST_F(AravisCameraTest, LostCameraIsReportedAndCanComeBack) {
  Start();
  ASSERT_TRUE(Open(Options()).ok());
  ASSERT_TRUE(Ready(kSmall).ok());
  absl::StatusOr<Frame> before = TakeWithRetakes(milliseconds(10));
  ASSERT_TRUE(before.ok()) << before.status();
  process_->Kill();
  TimePoint start = clock_.Now();
  absl::Status status = Take(milliseconds(10), milliseconds(500)).status();
  EXPECT_EQ(ErrorReason(status), "DEVICE_SILENT") << status;
  EXPECT_LT(clock_.Now() - start, seconds(5));
  // The heartbeat notices after about 6 s.
  TimePoint give_up = clock_.Now() + seconds(60);
  while (!absl::IsUnavailable(status) && clock_.Now() < give_up) {
    SleepFor(clock_, seconds(2));
    status = Take(milliseconds(10), milliseconds(100)).status();
    EXPECT_TRUE(absl::IsDeadlineExceeded(status) || absl::IsUnavailable(status)) << status;
  }
  EXPECT_EQ(ErrorReason(status), "DEVICE_LOST") << status;

  EXPECT_TRUE(Do([&](TimePoint deadline, Completion<CameraConfig> done) {
                camera_->Disarm(deadline, std::move(done));
              }).ok());
  Start();
  absl::Status ready = Ready(kSmall);
  ASSERT_TRUE(ready.ok()) << ready;
  absl::StatusOr<Frame> after = TakeWithRetakes(milliseconds(10));
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_GT(after->sequence, before->sequence);
}

// As the cable does: the camera is silent and has its state when it answers again.
TEST_F(AravisCameraTest, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  ExpectUnplugging([&](bool plugged) { process_->Suspend(!plugged); });
}

TEST_F(AravisCameraTest, SwitchedOffIsToldWithinASecondAndKeepsNothingOpen) {
  ExpectUnplugging([&](bool plugged) { plugged ? Start() : process_->Kill(); });
}

// Restarted while armed, as after a power cut: what it was configured to is applied again by Arm alone.
TEST_F(AravisCameraTest, RestartedCameraIsConnectedAnewByArm) {
  Start();
  ASSERT_TRUE(Open(Options()).ok());
  ASSERT_TRUE(Ready(kSmall).ok());
  process_->Kill();
  Start();
  absl::Status status;
  const TimePoint give_up = clock_.Now() + seconds(60);
  while (ErrorReason(status) != "DEVICE_LOST" && clock_.Now() < give_up) {
    SleepFor(clock_, milliseconds(300));
    status = Take(milliseconds(10), milliseconds(100)).status();
    EXPECT_FALSE(status.ok()) << "the new camera streams to nobody";
  }
  EXPECT_EQ(ErrorReason(status), "DEVICE_LOST") << status;
  EXPECT_TRUE(Do([&](TimePoint deadline, Completion<CameraConfig> done) {
                camera_->Disarm(deadline, std::move(done));
              }).ok());
  absl::StatusOr<CameraConfig> armed = Do([&](TimePoint deadline, Completion<CameraConfig> done) {
    camera_->Arm(deadline, std::move(done));
  });
  ASSERT_TRUE(armed.ok()) << armed.status();
  EXPECT_EQ(*armed, kSmall);
  absl::StatusOr<Frame> after = TakeWithRetakes(milliseconds(10));
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_TRUE(IsDiagonalRamp(*after));
}

// A camera that is reached in another way than GigE, as USB3 Vision is: Aravis' fake one within the process. It streams freely, so that no
// more than opening and configuring it can be shown.
TEST_F(AravisCameraTest, CamerasThatAreNotGigEAreOpenedWithoutItsSettings) {
  arv_enable_interface("Fake");
  AravisOptions options;
  options.serial = "1";
  absl::Status opened = Open(options);
  EXPECT_TRUE(opened.ok()) << opened;
  if (opened.ok()) {
    absl::StatusOr<CameraConfig> configured =
        Do([&](TimePoint deadline, Completion<CameraConfig> done) {
          camera_->Configure(kSmall, deadline, std::move(done));
        });
    EXPECT_TRUE(configured.ok()) << configured.status();
  }
  options.packet_timeout = milliseconds(40);
  opened = Open(options);
  EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE") << opened;
  EXPECT_NE(opened.message().find("packet_timeout_ms"), std::string_view::npos) << opened;
  arv_disable_interface("Fake");
}

// Aravis' own fake camera has one input line, of one edge, and no outputs.
TEST_F(AravisCameraTest, LinesThatTheCameraHasNotAreRefused) {
  Start();
  const auto refusal = [&](auto change) {
    AravisOptions options = Options();
    change(options);
    absl::Status opened = Open(options);
    EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE") << opened;
    return MessageOf(opened);
  };
  EXPECT_EQ(refusal([](AravisOptions& options) {
              options.trigger_source = "Line1";
              options.trigger_activation = "RisingEdge";
            }),
            "camera: trigger_source needs TriggerSource = Line1; the camera has Line0, Software");
  EXPECT_EQ(refusal([](AravisOptions& options) {
              options.trigger_source = "Line0";
              options.trigger_activation = "FallingEdge";
            }),
            "camera: trigger_activation needs TriggerActivation = FallingEdge; the camera has "
            "RisingEdge");
  EXPECT_EQ(refusal([](AravisOptions& options) { options.exposure_active_line = "Line1"; }),
            "camera: exposure_active_line needs LineSelector = Line1; the camera has no "
            "LineSelector");
}

TEST_F(AravisCameraTest, ClosingWithADeadCameraEnds) {
  Start();
  ASSERT_TRUE(Open(Options()).ok());
  ASSERT_TRUE(Ready(kSmall).ok());
  process_->Kill();
  Pending<ExposureEnd> ended(clock_);
  Pending<Frame> frame(clock_);
  camera_->Trigger(milliseconds(10), clock_.Now() + seconds(60), ended.sink(), frame.sink());
  TimePoint start = clock_.Now();
  camera_.reset();
  EXPECT_LT(clock_.Now() - start, seconds(30));
  ASSERT_TRUE(frame.done());
  EXPECT_EQ(frame.Wait(clock_.Now(), "frame").status().code(), absl::StatusCode::kCancelled);
}

TEST(AravisDriver, OpensWhatTheRigFileSays) {
  absl::StatusOr<FakeCameraProcess> process = FakeCameraProcess::Start("GV42");
  ASSERT_TRUE(process.ok()) << process.status();
  absl::StatusOr<TomlDocument> document =
      TomlDocument::Parse("[camera]\naddress = \"127.0.0.1\"\nserial = \"GV42\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  Driver<Camera> driver = AravisDriver();
  EXPECT_FALSE(driver.on_virtual_time);
  DeviceOpener<Camera> open = driver.parse(document->root().Table("camera"));
  ASSERT_TRUE(document->Finish().ok()) << document->Finish();
  RealClock clock;
  absl::StatusOr<std::unique_ptr<Camera>> camera = open({"camera", &clock, nullptr});
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ((*camera)->info().identity.serial, "GV42");
}

}  // namespace
}  // namespace lightstage
