// The driver against a camera that runs in this process: the contract, formats, regions, controls, finding it.
#include "drivers/v4l2/v4l2_camera.h"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>

#include "drivers/conformance/fixtures.h"
#include "drivers/v4l2/fake_picture.h"
#include "drivers/v4l2/fake_system.h"
#include "drivers/v4l2/photographer.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

std::vector<FakeControl> WebcamControls() {
  return {{V4L2_CID_EXPOSURE_AUTO, "Auto Exposure", 0, 3, 1, V4L2_EXPOSURE_APERTURE_PRIORITY},
          {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 1, 5000, 1, 157},
          {V4L2_CID_EXPOSURE_AUTO_PRIORITY, "Exposure, Dynamic Framerate", 0, 1, 1, 1},
          {V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", 0, 1, 1, 1},
          {V4L2_CID_GAIN, "Gain", 16, 96, 1, 60}};
}

FakeSetup Webcam() {
  FakeSetup setup;
  setup.formats = {{V4L2_PIX_FMT_GREY, {{64, 48}, {32, 24}}},
                   {V4L2_PIX_FMT_Y10P, {{64, 48}, {32, 24}}},
                   {V4L2_PIX_FMT_YUYV, {{64, 48}, {32, 24}}},
                   {V4L2_PIX_FMT_MJPEG, {{64, 48}, {32, 24}}}};
  setup.controls = WebcamControls();
  return setup;
}

V4l2Options Options() {
  V4l2Options options;
  options.device = "/dev/video0";
  options.frames_per_s = 50;
  options.gain_db_per_step = 0.3;
  return options;
}

// ---- Conformance

class V4l2Fixture : public CameraFixture {
 public:
  V4l2Fixture(FakeSetup setup, V4l2Options options)
      : camera_(std::move(setup)), options_(std::move(options)) {
    system_.Add("/dev/video0", &camera_);
  }
  ~V4l2Fixture() override {
    EXPECT_EQ(camera_.open_handles(), 0);
    EXPECT_EQ(camera_.mappings(), 0);
  }
  Clock& clock() override { return clock_; }
  absl::StatusOr<std::unique_ptr<Camera>> Open() override {
    return V4l2Camera::Open(system_, options_, {"camera", &clock_, nullptr});
  }

 private:
  RealClock clock_;
  FakeCamera camera_;
  FakeVideoSystem system_;
  const V4l2Options options_;
};

[[maybe_unused]] const bool kConformance = RegisterCameraConformance(
    "V4l2", [] { return std::make_unique<V4l2Fixture>(Webcam(), Options()); });

// A sensor that cuts regions, whose delay is known.
[[maybe_unused]] const bool kConformanceOfSensor = RegisterCameraConformance("V4l2Sensor", [] {
  FakeSetup setup;
  setup.formats = {{V4L2_PIX_FMT_SRGGB10P, {{64, 48}}}, {V4L2_PIX_FMT_Y12, {{64, 48}}}};
  setup.controls = {{V4L2_CID_EXPOSURE, "Exposure", 4, 4000, 2, 100},
                    {V4L2_CID_ANALOGUE_GAIN, "Analogue Gain", 0, 232, 1, 10},
                    {V4L2_CID_DIGITAL_GAIN, "Digital Gain", 256, 4095, 1, 1000}};
  setup.crops = true;
  setup.line_padding = 12;
  V4l2Options options = Options();
  options.exposure_unit_us = 25;
  options.latency = milliseconds(12);
  return std::make_unique<V4l2Fixture>(setup, options);
});

// As vivid: nothing can be set, and stamps lie in the future.
[[maybe_unused]] const bool kConformanceOfGrabber = RegisterCameraConformance("V4l2Grabber", [] {
  FakeSetup setup = Webcam();
  setup.controls.clear();
  setup.stamp = FakeStamp::kFuture;
  V4l2Options options = Options();
  options.fixed_exposure = milliseconds(10);
  options.gain_db_per_step = 0;
  options.frames_per_s.reset();
  return std::make_unique<V4l2Fixture>(setup, options);
});

// ---- What only this driver has

class V4l2CameraTest : public testing::Test {
 protected:
  void PlugIn(FakeSetup setup) {
    camera_.reset();
    fake_ = std::make_unique<FakeCamera>(std::move(setup));
    system_.Add("/dev/video0", fake_.get());
  }
  absl::Status Open(const V4l2Options& options = Options()) {
    camera_.reset();
    ASSIGN_OR_RETURN(camera_, V4l2Camera::Open(system_, options, {"camera", &clock_, nullptr}));
    return absl::OkStatus();
  }
  Photographer photographer() { return {clock_, *camera_}; }

  RealClock clock_;
  std::unique_ptr<FakeCamera> fake_;
  FakeVideoSystem system_;
  std::unique_ptr<Camera> camera_;
};

TEST_F(V4l2CameraTest, TellsWhatTheCameraIs) {
  PlugIn(Webcam());
  const absl::Status opened = Open();
  ASSERT_TRUE(opened.ok()) << opened;
  const CameraInfo& info = camera_->info();
  EXPECT_EQ(info.identity.driver, "v4l2");
  EXPECT_EQ(info.identity.model, "Test camera (usb-0000:00:14.0-1)");
  EXPECT_EQ(info.sensor_width, 64);
  EXPECT_EQ(info.formats,
            (std::vector{PixelFormat::kMono8, PixelFormat::kMono16, PixelFormat::kRGB8}));
  EXPECT_EQ(info.min_exposure, microseconds(100));
  EXPECT_EQ(info.max_exposure, milliseconds(20));  // at 50 frames/s
  EXPECT_EQ(info.exposure_step, microseconds(100));
  EXPECT_DOUBLE_EQ(info.max_gain_db, 24);
}

TEST_F(V4l2CameraTest, ControlsAreWhatWasConfigured) {
  PlugIn(Webcam());
  ASSERT_TRUE(Open().ok());
  EXPECT_EQ(fake_->control(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(fake_->control(V4L2_CID_EXPOSURE_AUTO_PRIORITY), 0);
  fake_->SetControl(V4L2_CID_AUTO_WHITE_BALANCE, 1);  // somebody turns it on
  ASSERT_TRUE(photographer().Ready({PixelFormat::kMono8, 64, 48, 6}).ok());
  EXPECT_EQ(fake_->control(V4L2_CID_AUTO_WHITE_BALANCE), 0);
  EXPECT_EQ(fake_->control(V4L2_CID_GAIN), 36);
  const absl::StatusOr<Frame> frame = photographer().Take(microseconds(1570));
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(fake_->control(V4L2_CID_EXPOSURE_ABSOLUTE), 16);
  EXPECT_EQ(frame->exposure, microseconds(1600));
  EXPECT_EQ(frame->gain_db, 6);
}

// The sensor's own gain is what is set. What multiplies numbers stands as the maker made it, whoever changed it before.
TEST_F(V4l2CameraTest, TheAnalogueGainIsSetAndTheOthersStandAtTheirDefault) {
  FakeSetup setup = Webcam();
  setup.controls = {{V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 1, 5000, 1, 157},
                    {V4L2_CID_ANALOGUE_GAIN, "Analogue Gain", 16, 232, 1, 99},
                    {V4L2_CID_GAIN, "Gain", 0, 100, 1, 77},
                    {V4L2_CID_DIGITAL_GAIN, "Digital Gain", 256, 4095, 1, 1000}};
  setup.controls[2].default_value = 40;
  setup.controls[3].default_value = 300;
  PlugIn(setup);
  ASSERT_TRUE(Open().ok());
  EXPECT_EQ(fake_->control(V4L2_CID_GAIN), 40);
  EXPECT_EQ(fake_->control(V4L2_CID_DIGITAL_GAIN), 300);
  EXPECT_DOUBLE_EQ(camera_->info().max_gain_db, (232 - 16) * 0.3);
  for (const auto& [gain_db, code] : {std::pair(6.0, 36), std::pair(0.0, 16)}) {
    ASSERT_TRUE(photographer().Configure({PixelFormat::kMono8, 64, 48, gain_db}).ok());
    EXPECT_EQ(fake_->control(V4L2_CID_ANALOGUE_GAIN), code);
    EXPECT_EQ(fake_->control(V4L2_CID_GAIN), 40);
    EXPECT_EQ(fake_->control(V4L2_CID_DIGITAL_GAIN), 300);
  }
}

TEST_F(V4l2CameraTest, AnAutomaticThatStaysOnIsRefusedUnlessItMay) {
  FakeSetup setup = Webcam();
  setup.controls[3].stuck = true;
  PlugIn(setup);
  const absl::Status opened = Open();
  EXPECT_EQ(ErrorReason(opened), "CONTROL_AUTOMATIC") << opened;
  EXPECT_NE(opened.message().find("White Balance, Automatic"), std::string_view::npos) << opened;
  EXPECT_EQ(fake_->open_handles(), 0);
  V4l2Options options = Options();
  options.leave_automatic = {"white_balance"};
  EXPECT_TRUE(Open(options).ok());
}

TEST_F(V4l2CameraTest, AnExposureThatIsNotTakenIsNoFrame) {
  FakeSetup setup = Webcam();
  setup.controls[1].stuck = true;
  PlugIn(setup);
  ASSERT_TRUE(Open().ok());
  ASSERT_TRUE(photographer().Ready({PixelFormat::kMono8, 64, 48, 0}).ok());
  const absl::Status taken = photographer().Take(milliseconds(5)).status();
  EXPECT_EQ(ErrorReason(taken), "CONTROL_REFUSED") << taken;
  EXPECT_NE(taken.message().find("Exposure Time, Absolute"), std::string_view::npos) << taken;
  EXPECT_TRUE(photographer().Take(microseconds(15700)).ok());  // the one that it has
}

TEST_F(V4l2CameraTest, AnExposureLongerThanAFrameIsRefusedOnceTheRateIsKnown) {
  PlugIn(Webcam());
  V4l2Options options = Options();
  options.frames_per_s.reset();
  ASSERT_TRUE(Open(options).ok());
  EXPECT_EQ(camera_->info().max_exposure, milliseconds(500));
  ASSERT_TRUE(photographer().Ready({PixelFormat::kMono8, 64, 48, 0}).ok());
  EXPECT_EQ(camera_->ValidateExposure(milliseconds(30)).verdict, ConfigVerdict::kAdjusted);
  EXPECT_EQ(ErrorReason(photographer().Take(milliseconds(30)).status()), "EXPOSURE_RANGE");
  EXPECT_TRUE(photographer().Take(milliseconds(20)).ok());
}

TEST_F(V4l2CameraTest, WhatTheDriverCanNotKnowMustBeGiven) {
  FakeSetup setup = Webcam();
  setup.controls = {{V4L2_CID_EXPOSURE, "Exposure", 4, 1000, 1, 100}};
  PlugIn(setup);
  V4l2Options options = Options();
  options.gain_db_per_step = 0;
  absl::Status opened = Open(options);
  EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE");
  EXPECT_NE(opened.message().find("exposure_unit_us"), std::string_view::npos) << opened;
  options.fixed_exposure = milliseconds(10);
  opened = Open(options);
  EXPECT_NE(opened.message().find("can be set ('Exposure')"), std::string_view::npos) << opened;
  setup.controls.clear();
  PlugIn(setup);
  EXPECT_TRUE(Open(options).ok());
  options.fixed_exposure.reset();
  opened = Open(options);
  EXPECT_NE(opened.message().find("fixed_exposure_us"), std::string_view::npos) << opened;
  options.exposure_unit_us = 25;
  EXPECT_EQ(ErrorReason(Open(options)), "DEVICE_UNSUITABLE");
}

// Every packing on its whole way; the camera packs by the kernel's tables, independently of the driver.
TEST_F(V4l2CameraTest, EveryFormatComesThroughBitByBit) {
  struct Case {
    uint32_t fourcc;
    PixelFormat format;
    int bits;
  };
  for (const Case& c :
       std::initializer_list<Case>{{V4L2_PIX_FMT_GREY, PixelFormat::kMono8, 8},
                                   {V4L2_PIX_FMT_Y10, PixelFormat::kMono16, 10},
                                   {V4L2_PIX_FMT_Y12, PixelFormat::kMono16, 12},
                                   {V4L2_PIX_FMT_Y14, PixelFormat::kMono16, 14},
                                   {V4L2_PIX_FMT_Y16, PixelFormat::kMono16, 16},
                                   {V4L2_PIX_FMT_Y16_BE, PixelFormat::kMono16, 16},
                                   {V4L2_PIX_FMT_Y10P, PixelFormat::kMono16, 10},
                                   {v4l2_fourcc('Y', '1', '2', 'P'), PixelFormat::kMono16, 12},
                                   {v4l2_fourcc('Y', '1', '4', 'P'), PixelFormat::kMono16, 14},
                                   {V4L2_PIX_FMT_Y10BPACK, PixelFormat::kMono16, 10},
                                   {V4L2_PIX_FMT_YUYV, PixelFormat::kMono8, 8},
                                   {V4L2_PIX_FMT_UYVY, PixelFormat::kMono8, 8},
                                   {V4L2_PIX_FMT_SBGGR8, PixelFormat::kBayerBG8, 8},
                                   {V4L2_PIX_FMT_SGBRG8, PixelFormat::kBayerGB8, 8},
                                   {V4L2_PIX_FMT_SGRBG8, PixelFormat::kBayerGR8, 8},
                                   {V4L2_PIX_FMT_SRGGB8, PixelFormat::kBayerRG8, 8},
                                   {V4L2_PIX_FMT_SRGGB10, PixelFormat::kBayerRG16, 10},
                                   {V4L2_PIX_FMT_SRGGB12, PixelFormat::kBayerRG16, 12},
                                   {V4L2_PIX_FMT_SRGGB14, PixelFormat::kBayerRG16, 14},
                                   {V4L2_PIX_FMT_SRGGB16, PixelFormat::kBayerRG16, 16},
                                   {V4L2_PIX_FMT_SBGGR10P, PixelFormat::kBayerBG16, 10},
                                   {V4L2_PIX_FMT_SBGGR12P, PixelFormat::kBayerBG16, 12},
                                   {V4L2_PIX_FMT_SBGGR14P, PixelFormat::kBayerBG16, 14},
                                   {V4L2_PIX_FMT_RGB24, PixelFormat::kRGB8, 8},
                                   {V4L2_PIX_FMT_BGR24, PixelFormat::kRGB8, 8}}) {
    FakeSetup setup = Webcam();
    setup.formats = {{c.fourcc, {{38, 10}}}};  // no whole number of groups
    setup.line_padding = 7;
    setup.pattern = true;
    setup.interval = milliseconds(10);
    PlugIn(setup);
    V4l2Options options = Options();
    options.frames_per_s.reset();
    options.fourcc = c.fourcc;  // of YUYV and UYVY only so the luma as it is
    const absl::Status opened = Open(options);
    ASSERT_TRUE(opened.ok()) << opened;
    ASSERT_TRUE(photographer().Ready({c.format, 38, 10, 0}).ok());
    const absl::StatusOr<Frame> frame = photographer().Take(milliseconds(1));
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->significant_bits, c.bits);
    const int channels = SamplesPerPixel(c.format), bytes = BytesPerSample(c.format);
    ASSERT_EQ(frame->data.size(), static_cast<size_t>(38 * 10 * channels * bytes));
    int wrong = 0;
    for (int i = 0; i < 38 * 10 * channels; ++i) {
      const int pixel = i / channels;
      auto value = static_cast<unsigned>(frame->data[i * bytes]);
      if (bytes == 2) value |= static_cast<unsigned>(frame->data[i * 2 + 1]) << 8;
      wrong += value != FakeSample(pixel % 38, pixel / 38, i % channels, c.bits);
    }
    EXPECT_EQ(wrong, 0) << FourCcName(c.fourcc);
  }
}

TEST_F(V4l2CameraTest, YuvIsRgbUnlessItsLumaIsNamed) {
  for (uint32_t fourcc : {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY}) {
    FakeSetup setup = Webcam();
    setup.formats = {{fourcc, {{32, 24}}}};
    PlugIn(setup);
    ASSERT_TRUE(Open().ok());
    EXPECT_EQ(camera_->info().formats, std::vector{PixelFormat::kRGB8});
    fake_->SetLight(1);  // 191 of 16 to 235
    ASSERT_TRUE(photographer().Ready({PixelFormat::kRGB8, 32, 24, 0}).ok());
    absl::StatusOr<Frame> frame = photographer().Take(milliseconds(5));
    ASSERT_TRUE(frame.ok()) << frame.status();
    for (std::byte b : frame->data) ASSERT_EQ(static_cast<int>(b), 204);  // (191 − 16) · 255 / 219
    V4l2Options options = Options();
    options.fourcc = fourcc;
    ASSERT_TRUE(Open(options).ok());
    ASSERT_TRUE(photographer().Ready({PixelFormat::kMono8, 32, 24, 0}).ok());
    frame = photographer().Take(milliseconds(5));
    ASSERT_TRUE(frame.ok()) << frame.status();
    for (std::byte b : frame->data) ASSERT_EQ(static_cast<int>(b), 191);
  }
}

TEST_F(V4l2CameraTest, YuvOfAnotherRangeOrMatrix) {
  FakeSetup setup = Webcam();
  setup.formats = {{V4L2_PIX_FMT_YUYV, {{32, 24}}}};
  setup.quantization = V4L2_QUANTIZATION_FULL_RANGE;
  PlugIn(setup);
  ASSERT_TRUE(Open().ok());
  fake_->SetLight(1);
  ASSERT_TRUE(photographer().Ready({PixelFormat::kRGB8, 32, 24, 0}).ok());
  const absl::StatusOr<Frame> frame = photographer().Take(milliseconds(5));
  ASSERT_TRUE(frame.ok()) << frame.status();
  for (std::byte b : frame->data) ASSERT_EQ(static_cast<int>(b), 191);
  setup.ycbcr_enc = V4L2_YCBCR_ENC_709;
  PlugIn(setup);
  const absl::Status opened = Open();
  EXPECT_EQ(ErrorReason(opened), "CAMERA_FORMAT") << opened;
  EXPECT_NE(opened.message().find("BT.601"), std::string_view::npos) << opened;
}

TEST_F(V4l2CameraTest, CamerasOfOtherKindsAreRefusedWithTheReason) {
  FakeSetup setup = Webcam();
  setup.formats = {{V4L2_PIX_FMT_MJPEG, {{64, 48}}}};
  PlugIn(setup);
  absl::Status opened = Open();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE");
  EXPECT_NE(opened.message().find("MJPG"), std::string_view::npos) << opened;
  EXPECT_NE(opened.message().find("only if it is named"), std::string_view::npos) << opened;
  setup = Webcam();
  setup.field = V4L2_FIELD_INTERLACED;
  PlugIn(setup);
  opened = Open();
  EXPECT_NE(opened.message().find("interlaced"), std::string_view::npos) << opened;
  setup = Webcam();
  setup.multi_planar = true;
  PlugIn(setup);
  opened = Open();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_NOT_FOUND");
  EXPECT_NE(opened.message().find("multi-planar"), std::string_view::npos) << opened;
  VirtualClock virtual_clock;
  EXPECT_EQ(ErrorReason(
                V4l2Camera::Open(system_, Options(), {"camera", &virtual_clock, nullptr}).status()),
            "DEVICE_UNSUITABLE");
}

TEST_F(V4l2CameraTest, TheRegionIsInTheMiddle) {
  FakeSetup setup = Webcam();
  setup.formats = {{V4L2_PIX_FMT_GREY, {{64, 48}}}};
  setup.crops = true;
  setup.pattern = true;
  PlugIn(setup);
  ASSERT_TRUE(Open().ok());
  EXPECT_EQ(camera_->Validate({PixelFormat::kMono8, 31, 16, 0}).config.width, 28);
  EXPECT_EQ(camera_->Validate({PixelFormat::kMono8, 4, 16, 0}).config.width, 8);
  EXPECT_TRUE(photographer().Configure({PixelFormat::kMono8, 8, 8, 0}).ok());
  ASSERT_TRUE(photographer().Ready({PixelFormat::kMono8, 32, 16, 0}).ok());
  EXPECT_EQ(fake_->region_at(), std::pair(16, 16));
  const absl::StatusOr<Frame> frame = photographer().Take(milliseconds(5));
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->width, 32);
  EXPECT_EQ(static_cast<unsigned>(frame->data[0]), FakeSample(16, 16, 0, 8));
  EXPECT_EQ(static_cast<unsigned>(frame->data.back()), FakeSample(47, 31, 0, 8));
}

TEST_F(V4l2CameraTest, ThePictureFillsTheFrame) {
  FakeSetup setup = Webcam();
  setup.composes = true;
  PlugIn(setup);
  ASSERT_TRUE(Open().ok());
  fake_->SetLight(1);
  ASSERT_TRUE(photographer().Ready({PixelFormat::kMono8, 64, 48, 0}).ok());
  const absl::StatusOr<Frame> frame = photographer().Take(milliseconds(5));
  ASSERT_TRUE(frame.ok()) << frame.status();
  for (std::byte b : frame->data) ASSERT_EQ(static_cast<int>(b), 191);
}

TEST_F(V4l2CameraTest, ARateThatIsNotTakenIsRefused) {
  PlugIn(Webcam());
  V4l2Options options = Options();
  options.frames_per_s = 1000;
  ASSERT_TRUE(Open(options).ok());
  const absl::Status configured =
      photographer().Configure({PixelFormat::kMono8, 64, 48, 0}).status();
  EXPECT_EQ(ErrorReason(configured), "CAMERA_FORMAT") << configured;
  EXPECT_NE(configured.message().find("frames_per_s = 1000 was set and is 100"),
            std::string_view::npos)
      << configured;
}

TEST_F(V4l2CameraTest, ACameraIsFoundByWhatItIs) {
  FakeSetup second = Webcam();
  second.bus_info = "usb-0000:00:14.0-2";
  FakeSetup metadata = Webcam();
  metadata.metadata_node = true;
  FakeCamera other(second), beside(metadata);
  PlugIn(Webcam());
  system_.Add("/dev/video1", &beside);
  system_.Add("/dev/video2", &other);
  V4l2Options options = Options();
  options.device.clear();
  options.card = "Test camera";
  absl::Status opened = Open(options);
  EXPECT_EQ(ErrorReason(opened), "DEVICE_UNSUITABLE") << opened;
  EXPECT_NE(opened.message().find("usb-0000:00:14.0-2"), std::string_view::npos) << opened;
  options.bus_info = "usb-0000:00:14.0-2";
  ASSERT_TRUE(Open(options).ok());
  EXPECT_EQ(other.open_handles(), 1);
  EXPECT_EQ(fake_->open_handles(), 0);
  options.bus_info = "usb-0000:00:14.0-9";
  opened = Open(options);
  EXPECT_EQ(ErrorReason(opened), "DEVICE_NOT_FOUND") << opened;
  EXPECT_NE(opened.message().find("/dev/video1: Test camera (usb-0000:00:14.0-1) does not capture"),
            std::string_view::npos)
      << opened;
  camera_.reset();
}

TEST_F(V4l2CameraTest, ACameraThatSomebodyUsesIsBusyAndTheyAreNamed) {
  PlugIn(Webcam());
  system_.SetHolders("cheese (process 4711)");
  fake_->FailNext(VIDIOC_S_FMT, EBUSY, 1000);
  absl::Status busy = Open();
  EXPECT_EQ(ErrorReason(busy), "DEVICE_BUSY") << busy;
  EXPECT_NE(busy.message().find("cheese (process 4711)"), std::string_view::npos) << busy;
  fake_->FailNext(VIDIOC_REQBUFS, EBUSY);
  fake_->FailNext(VIDIOC_S_FMT, EBUSY, 0);
  Open().IgnoreError();
  ASSERT_TRUE(Open().ok());
  ASSERT_TRUE(photographer().Configure({PixelFormat::kMono8, 64, 48, 0}).ok());
  fake_->FailNext(VIDIOC_REQBUFS, EBUSY);
  busy = photographer().Arm().status();
  EXPECT_EQ(ErrorReason(busy), "DEVICE_BUSY") << busy;
  EXPECT_TRUE(photographer().Arm().ok());
}

}  // namespace
}  // namespace lightstage
