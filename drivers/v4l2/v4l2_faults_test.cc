// The driver against a camera that runs in this process: which frames it takes, and what it does when the camera fails.
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <functional>
#include <random>
#include <thread>

#include "drivers/conformance/unplug.h"
#include "drivers/v4l2/fake_system.h"
#include "drivers/v4l2/photographer.h"
#include "drivers/v4l2/v4l2_camera.h"

namespace lightstage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr CameraConfig kConfig{PixelFormat::kMono8, 32, 24, 0};

FakeSetup Webcam() {
  FakeSetup setup;
  setup.formats = {{V4L2_PIX_FMT_GREY, {{32, 24}}}};
  setup.controls = {{V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 1, 5000, 1, 100}};
  return setup;
}

// One whose next frame is far enough away for something to happen to it before.
FakeSetup Slow() {
  FakeSetup setup = Webcam();
  setup.interval = milliseconds(150);
  return setup;
}

V4l2Options Options() {
  V4l2Options options;
  options.card = "Test camera";
  return options;
}

class V4l2FaultsTest : public testing::Test {
 protected:
  void Start(FakeSetup setup = Webcam(), const V4l2Options& options = Options()) {
    camera_.reset();
    fake_ = std::make_unique<FakeCamera>(std::move(setup));
    system_.Add("/dev/video0", fake_.get());
    absl::StatusOr<std::unique_ptr<Camera>> camera =
        V4l2Camera::Open(system_, options, {"camera", &clock_, nullptr});
    ASSERT_TRUE(camera.ok()) << camera.status();
    camera_ = *std::move(camera);
    photographer_ = std::make_unique<Photographer>(clock_, *camera_);
    const absl::Status ready = photographer_->Ready(kConfig);
    ASSERT_TRUE(ready.ok()) << ready;
  }
  void TearDown() override {
    camera_.reset();
    EXPECT_EQ(fake_->open_handles(), 0);
    EXPECT_EQ(fake_->mappings(), 0);
  }
  absl::StatusOr<Frame> Take(Duration exposure = milliseconds(5)) {
    return photographer_->Take(exposure);
  }

  // A shot of a slow camera, and `fault` while it is waited for: the camera has been told its exposure, and is some frames away from it.
  absl::Status TakeDuring(const std::function<void()>& fault) {
    std::thread during([&] {
      const TimePoint give_up = clock_.Now() + seconds(10);
      while (fake_->control(V4L2_CID_EXPOSURE_ABSOLUTE) != 150 && clock_.Now() < give_up) {
        SleepFor(clock_, milliseconds(1));
      }
      SleepFor(clock_, milliseconds(10));  // for it to be read back
      fault();
    });
    const absl::Status taken = Take(milliseconds(15)).status();
    during.join();
    return taken;
  }

  // Of so many shots, those with a row that did not get the full light. The light goes on at any moment of the camera's frames just before
  // the trigger, and off as soon as the exposure has ended.
  int PartlyLit(int shots, const std::vector<Duration>& exposures) {
    std::mt19937 random(7);
    std::uniform_int_distribution<int> us(0, 25000);
    int bad = 0;
    for (int i = 0; i < shots; ++i) {
      std::this_thread::sleep_for(microseconds(us(random)));
      fake_->SetLight(1);
      const absl::StatusOr<Frame> frame = photographer_->Take(
          exposures[i % exposures.size()], seconds(20), [this] { fake_->SetLight(0); });
      EXPECT_TRUE(frame.ok()) << frame.status();
      if (!frame.ok()) return shots;
      bad += std::any_of(frame->data.begin(), frame->data.end(),
                         [](std::byte b) { return b != std::byte{191}; });
    }
    return bad;
  }

  RealClock clock_;
  std::unique_ptr<FakeCamera> fake_;
  FakeVideoSystem system_;
  std::unique_ptr<Camera> camera_;
  std::unique_ptr<Photographer> photographer_;
};

// ---- Only light from after the trigger

constexpr int kShots = 25;

TEST_F(V4l2FaultsTest, NoFrameSawTheLightBefore) {
  for (FakeStamp stamp : {FakeStamp::kEndOfFrame, FakeStamp::kFirstPacket, FakeStamp::kExposure,
                          FakeStamp::kFuture, FakeStamp::kUnknownClock}) {
    FakeSetup setup = Webcam();
    setup.stamp = stamp;
    setup.readout = milliseconds(14);
    Start(setup);
    EXPECT_EQ(PartlyLit(kShots, {milliseconds(8)}), 0) << static_cast<int>(stamp);
  }
}

// One that can not have been there when the light was last wrong: not the one after it.
TEST_F(V4l2FaultsTest, WithoutABelievedStampTheNextFrameCounts) {
  FakeSetup setup = Webcam();
  setup.interval = milliseconds(100);
  setup.stamp = FakeStamp::kFuture;
  V4l2Options options = Options();
  options.latency = milliseconds(12);
  Start(setup, options);
  uint64_t least = UINT64_MAX, last = 0;
  for (int i = 0; i < 6; ++i) {
    const absl::StatusOr<Frame> frame = Take();
    ASSERT_TRUE(frame.ok()) << frame.status();
    if (last > 0) least = std::min(least, frame->sequence - last);
    last = frame->sequence;
  }
  EXPECT_EQ(least, 1u);
}

// With exposures that show two frames after they were set: none is taken for another.
TEST_F(V4l2FaultsTest, NoFrameHasAnotherExposureThanAsked) {
  Start();
  EXPECT_EQ(PartlyLit(kShots, {milliseconds(2), milliseconds(18), milliseconds(6)}), 0);
  // Light that is on all the time shows as a value that is exposure-independent here; the time on tells: half of it is half the value.
  for (Duration exposure : {milliseconds(4), milliseconds(16), milliseconds(8)}) {
    fake_->SetLight(1);
    const absl::StatusOr<Frame> frame = Take(exposure);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->exposure, exposure);
    EXPECT_EQ(frame->exposure_end - frame->exposure_start, exposure);
  }
}

// The measured latency saves frames and is exact; one that is too short lets light from before in, which is how it is measured.
TEST_F(V4l2FaultsTest, LatencyMustBeLongEnough) {
  FakeSetup setup = Webcam();
  setup.readout = milliseconds(8);
  setup.transport = milliseconds(5);
  V4l2Options options = Options();
  options.latency = milliseconds(13);
  Start(setup, options);
  EXPECT_EQ(PartlyLit(kShots, {milliseconds(6)}), 0);
  options.latency = milliseconds(0);
  Start(setup, options);
  EXPECT_GT(PartlyLit(2 * kShots, {milliseconds(6)}), 0);
}

TEST_F(V4l2FaultsTest, StampsAtTheStartOfExposureMayBeBelieved) {
  FakeSetup setup = Webcam();
  setup.stamp = FakeStamp::kExposure;
  V4l2Options options = Options();
  options.stamps_at_exposure_start = true;
  options.latency = milliseconds(0);
  Start(setup, options);
  EXPECT_EQ(PartlyLit(kShots, {milliseconds(10)}), 0);
  // uvcvideo's flags are the same, but its stamps are not: believing them is wrong, and seen.
  setup.stamp = FakeStamp::kFirstPacket;
  Start(setup, options);
  EXPECT_GT(PartlyLit(2 * kShots, {milliseconds(10)}), 0);
}

TEST_F(V4l2FaultsTest, ACameraThatDoesNotTellItsRateIsMeasured) {
  FakeSetup setup = Webcam();
  setup.tells_interval = false;
  setup.readout = milliseconds(14);
  Start(setup);
  EXPECT_EQ(PartlyLit(kShots, {milliseconds(8)}), 0);
}

TEST_F(V4l2FaultsTest, TimesAreOnTheRigsClock) {
  V4l2Options options = Options();
  options.latency = milliseconds(10);
  Start(Webcam(), options);
  const TimePoint before = clock_.Now();
  const absl::StatusOr<Frame> frame = Take(milliseconds(7));
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_GE(frame->exposure_start, before);
  EXPECT_LE(frame->exposure_end, clock_.Now());
  EXPECT_EQ(TimePoint(Duration(frame->device_timestamp_ns)),
            frame->exposure_end + milliseconds(10));
}

// ---- Frames that are not whole

TEST_F(V4l2FaultsTest, DamagedAndShortFramesAreIncomplete) {
  Start();
  ASSERT_TRUE(Take().ok());
  fake_->DamageNext(20);
  absl::Status taken = Take().status();
  EXPECT_EQ(ErrorReason(taken), "FRAME_INCOMPLETE") << taken;
  EXPECT_NE(taken.message().find("damaged"), std::string_view::npos) << taken;
  fake_->DamageNext(0);
  fake_->ShortenNext(20);
  taken = Take().status();
  EXPECT_EQ(ErrorReason(taken), "FRAME_INCOMPLETE") << taken;
  EXPECT_NE(taken.message().find("767 bytes of 768"), std::string_view::npos) << taken;
  fake_->ShortenNext(0);
  EXPECT_TRUE(Take().ok());
  EXPECT_EQ(fake_->streams_started(), 1);
}

TEST_F(V4l2FaultsTest, DroppedFramesAreCountedAndWaitedFor) {
  Start();
  const absl::StatusOr<Frame> before = Take();
  ASSERT_TRUE(before.ok());
  fake_->DropNext(4);
  const absl::StatusOr<Frame> after = Take();
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_GT(after->sequence, before->sequence + 4);
}

TEST_F(V4l2FaultsTest, ANumberThatGoesBackIsIncomplete) {
  Start(Slow());
  ASSERT_TRUE(Take().ok());
  const absl::Status taken = TakeDuring([&] { fake_->NumberNextBack(5); });
  EXPECT_EQ(ErrorReason(taken), "FRAME_INCOMPLETE") << taken;
  EXPECT_TRUE(Take(milliseconds(15)).ok());
}

TEST_F(V4l2FaultsTest, NumbersMayWrap) {
  FakeSetup setup = Webcam();
  setup.first_sequence = UINT32_MAX - 3;
  Start(setup);
  uint64_t last = 0;
  for (int i = 0; i < 4; ++i) {
    const absl::StatusOr<Frame> frame = Take();
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_GT(frame->sequence, last);
    EXPECT_LT(frame->sequence, 1000u);
    last = frame->sequence;
  }
}

// A control that is not ready is no other program's doing.
TEST_F(V4l2FaultsTest, AControlThatIsNotReadyIsBusyAndTheNextShotIsGood) {
  Start();
  fake_->FailNext(VIDIOC_S_EXT_CTRLS, EBUSY);
  const absl::Status busy = Take(milliseconds(7)).status();
  EXPECT_EQ(ErrorReason(busy), "DEVICE_BUSY") << busy;
  EXPECT_NE(busy.message().find("not ready"), std::string_view::npos) << busy;
  const absl::StatusOr<Frame> after = Take(milliseconds(7));
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(after->exposure, milliseconds(7));
}

// ---- Streams that end

TEST_F(V4l2FaultsTest, ABrokenStreamIsAFaultAndBeginsAnew) {
  Start(Slow());
  const absl::StatusOr<Frame> before = Take();
  ASSERT_TRUE(before.ok());
  const absl::Status broken = TakeDuring([&] { fake_->BreakStream(); });
  EXPECT_EQ(ErrorReason(broken), "DEVICE_FAULT") << broken;
  EXPECT_EQ(broken.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(broken.message().find("VIDIOC_DQBUF"), std::string_view::npos) << broken;
  const absl::StatusOr<Frame> after = Take();
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(fake_->streams_started(), 2);
  EXPECT_GT(after->sequence, before->sequence);
}

// They are no frames that count, not even for a camera that is being armed.
TEST_F(V4l2FaultsTest, BuffersThatComeBackEmptyAreAFaultAndTheStreamBeginsAnew) {
  Start(Slow());
  const absl::StatusOr<Frame> before = Take();
  ASSERT_TRUE(before.ok());
  const absl::Status broken = TakeDuring([&] { fake_->CancelBuffers(); });
  EXPECT_EQ(ErrorReason(broken), "DEVICE_FAULT") << broken;
  EXPECT_NE(broken.message().find("without a frame"), std::string_view::npos) << broken;
  const absl::StatusOr<Frame> after = Take();
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(after->exposure, milliseconds(5));
  EXPECT_EQ(fake_->streams_started(), 2);
  EXPECT_GT(after->sequence, before->sequence);
  EXPECT_LT(after->sequence, before->sequence + 20) << "the numbers of frames that never were";
}

TEST_F(V4l2FaultsTest, AStreamThatDoesNotBeginIsAFault) {
  Start();
  fake_->BreakStream();
  SleepFor(clock_, milliseconds(50));
  for (unsigned long request : {VIDIOC_STREAMON, VIDIOC_QBUF, VIDIOC_REQBUFS, VIDIOC_QUERYBUF}) {
    fake_->FailNext(request, EIO);
    const absl::Status taken = Take().status();
    EXPECT_EQ(ErrorReason(taken), "DEVICE_FAULT") << taken;
  }
  EXPECT_TRUE(Take().ok());
  ASSERT_TRUE(photographer_->Disarm().ok());
  fake_->FailNext(VIDIOC_STREAMON, ENOSPC);
  const absl::Status armed = photographer_->Arm().status();
  EXPECT_EQ(ErrorReason(armed), "DEVICE_FAULT");
  EXPECT_NE(armed.message().find("bandwidth"), std::string_view::npos) << armed;
  EXPECT_EQ(fake_->mappings(), 0);
  EXPECT_TRUE(photographer_->Arm().ok());
  EXPECT_TRUE(Take().ok());
}

TEST_F(V4l2FaultsTest, ABufferThatCanNotBeGivenBackIsAFault) {
  Start();
  ASSERT_TRUE(Take().ok());
  fake_->FailNext(VIDIOC_QBUF, EINVAL);
  const TimePoint give_up = clock_.Now() + seconds(10);
  while (fake_->fails_next(VIDIOC_QBUF) && clock_.Now() < give_up) {
    SleepFor(clock_, milliseconds(5));
  }
  EXPECT_TRUE(Take().ok());  // the stream has begun anew
  EXPECT_EQ(fake_->streams_started(), 2);
}

TEST_F(V4l2FaultsTest, ASilentCameraMissesTheDeadlineAndBeginsAnew) {
  Start();
  ASSERT_TRUE(Take().ok());
  fake_->SetSilent(true);
  const TimePoint before = clock_.Now();
  const absl::Status silent = photographer_->Take(milliseconds(5), milliseconds(400)).status();
  EXPECT_EQ(ErrorReason(silent), "DEVICE_SILENT") << silent;
  EXPECT_GE(clock_.Now() - before, milliseconds(400));
  EXPECT_LT(clock_.Now() - before, seconds(5));
  fake_->SetSilent(false);
  const absl::StatusOr<Frame> after = Take();
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(fake_->streams_started(), 2);
}

TEST_F(V4l2FaultsTest, ACameraThatSendsNothingIsNotArmed) {
  Start();
  ASSERT_TRUE(photographer_->Disarm().ok());
  fake_->SetSilent(true);
  const absl::Status armed = photographer_->Arm(milliseconds(300)).status();
  EXPECT_EQ(ErrorReason(armed), "DEVICE_SILENT") << armed;
  EXPECT_EQ(ErrorReason(Take().status()), "CAMERA_NOT_ARMED");
  fake_->SetSilent(false);
  EXPECT_TRUE(photographer_->Arm().ok());
  EXPECT_TRUE(Take().ok());
}

TEST_F(V4l2FaultsTest, DisarmEndsAnArmThatHangs) {
  Start();
  ASSERT_TRUE(photographer_->Disarm().ok());
  fake_->SetSilent(true);
  Pending<CameraConfig> arming(clock_);
  camera_->Arm(clock_.Now() + seconds(600), arming.sink());
  SleepFor(clock_, milliseconds(20));
  EXPECT_TRUE(photographer_->Disarm().ok());
  EXPECT_EQ(arming.Wait(clock_.Now() + seconds(20), "Arm").status().code(),
            absl::StatusCode::kCancelled);
}

// ---- Cameras that go

TEST_F(V4l2FaultsTest, UnpluggedIsToldWithinASecondAndKeepsNothingOpen) {
  Start();
  CheckUnplugging(clock_, "camera",
                  {.plug = [&](bool plugged) { plugged ? fake_->PlugIn() : fake_->Unplug(); },
                   .use = [&] { return Take(milliseconds(15)).status(); },
                   .recover =
                       [&] {
                         photographer_->Disarm().IgnoreError();
                         return photographer_->Ready(kConfig);
                       }});
}

TEST_F(V4l2FaultsTest, AnUnpluggedCameraIsLostAndComesBack) {
  Start(Slow());
  const absl::StatusOr<Frame> before = Take();
  ASSERT_TRUE(before.ok());
  const TimePoint start = clock_.Now();
  const absl::Status lost = TakeDuring([&] { fake_->Unplug(); });
  EXPECT_EQ(ErrorReason(lost), "DEVICE_LOST") << lost;
  EXPECT_TRUE(absl::IsUnavailable(lost));
  EXPECT_NE(lost.message().find("Test camera"), std::string_view::npos) << lost;
  EXPECT_LT(clock_.Now() - start, seconds(10));  // its deadline is twice as far
  EXPECT_EQ(fake_->open_handles(), 0);
  EXPECT_EQ(fake_->mappings(), 0);
  EXPECT_EQ(ErrorReason(Take().status()), "DEVICE_LOST");
  EXPECT_TRUE(photographer_->Disarm().ok());
  EXPECT_EQ(ErrorReason(photographer_->Arm().status()), "DEVICE_LOST");
  EXPECT_EQ(ErrorReason(photographer_->Configure(kConfig).status()), "DEVICE_LOST");

  // It comes back under another number, and what had its own is another camera.
  FakeSetup stranger = Webcam();
  stranger.bus_info = "usb-0000:00:14.0-7";
  FakeCamera other(stranger);
  system_.Add("/dev/video0", &other);
  EXPECT_EQ(ErrorReason(photographer_->Configure(kConfig).status()), "DEVICE_LOST");
  fake_->PlugIn();
  system_.Add("/dev/video3", fake_.get());
  const absl::Status ready = photographer_->Ready(kConfig);
  ASSERT_TRUE(ready.ok()) << ready;
  const absl::StatusOr<Frame> after = Take(milliseconds(15));
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_GT(after->sequence, before->sequence);
  EXPECT_EQ(fake_->control(V4L2_CID_EXPOSURE_ABSOLUTE), 150);
  EXPECT_EQ(other.open_handles(), 0);
  system_.Remove("/dev/video0");
}

TEST_F(V4l2FaultsTest, ACameraUnpluggedBetweenShotsIsNoticed) {
  Start();
  fake_->Unplug();
  const TimePoint give_up = clock_.Now() + seconds(10);
  while (fake_->open_handles() > 0 && clock_.Now() < give_up) SleepFor(clock_, milliseconds(5));
  EXPECT_EQ(fake_->open_handles(), 0);
  EXPECT_EQ(ErrorReason(Take().status()), "DEVICE_LOST");
}

TEST_F(V4l2FaultsTest, ACameraUnpluggedWhileIdleIsNoticedByTheNextOperation) {
  Start();
  ASSERT_TRUE(photographer_->Disarm().ok());
  fake_->Unplug();
  EXPECT_EQ(ErrorReason(photographer_->Configure(kConfig).status()), "DEVICE_LOST");
  EXPECT_EQ(fake_->open_handles(), 0);
  fake_->PlugIn();
  EXPECT_TRUE(photographer_->Ready(kConfig).ok());
  EXPECT_TRUE(Take().ok());
  ASSERT_TRUE(photographer_->Disarm().ok());
  fake_->Unplug();
  EXPECT_EQ(ErrorReason(photographer_->Arm().status()), "DEVICE_LOST");
  fake_->PlugIn();
  EXPECT_TRUE(photographer_->Ready(kConfig).ok());
}

// Nothing is left open over many ways down.
TEST_F(V4l2FaultsTest, ManyLossesLeaveNothingBehind) {
  Start();
  for (int i = 0; i < 5; ++i) {
    if (i % 2 == 0) fake_->BreakStream();
    fake_->Unplug();
    EXPECT_EQ(ErrorReason(Take().status()), "DEVICE_LOST");
    ASSERT_TRUE(photographer_->Disarm().ok());
    fake_->PlugIn();
    ASSERT_TRUE(photographer_->Ready(kConfig).ok());
    EXPECT_EQ(fake_->open_handles(), 1);
    EXPECT_EQ(fake_->mappings(), 4);
    EXPECT_TRUE(Take().ok());
  }
}

// A loss fails what was asked before it was told, not what whoever was told asks then.
TEST_F(V4l2FaultsTest, ALossDoesNotFailWhatFollowsIt) {
  for (const bool at_rest : {false, true}) {
    Start();
    if (at_rest) {  // it is noticed by starting the stream
      fake_->BreakStream();
      SleepFor(clock_, milliseconds(50));
      fake_->Unplug();
    } else {
      fake_->FailNext(VIDIOC_S_EXT_CTRLS, ENODEV);
    }
    Pending<CameraConfig> disarmed(clock_);
    camera_->Trigger(
        milliseconds(5), clock_.Now() + seconds(20), [](absl::StatusOr<ExposureEnd>) {},
        [&](absl::StatusOr<Frame> frame) {
          EXPECT_EQ(ErrorReason(frame.status()), "DEVICE_LOST");
          camera_->Disarm(clock_.Now() + seconds(20), disarmed.sink());
        });
    const auto config = disarmed.Wait(clock_.Now() + seconds(30), "disarming");
    EXPECT_TRUE(config.ok()) << at_rest << ": " << config.status();
  }
}

TEST_F(V4l2FaultsTest, ClosingEndsWhateverTheCameraDoes) {
  Start();
  fake_->SetSilent(true);
  Pending<Frame> frame(clock_);
  camera_->Trigger(
      milliseconds(5), clock_.Now() + seconds(600), [](absl::StatusOr<ExposureEnd>) {},
      frame.sink());
  camera_.reset();
  ASSERT_TRUE(frame.done());
  EXPECT_EQ(frame.Wait(clock_.Now(), "frame").status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace lightstage
