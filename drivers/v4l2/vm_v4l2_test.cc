// The driver against the kernel's vivid, in a virtual machine: not part of ctest. The node is in LIGHTSTAGE_VIDEO_DEVICE:
//
//   modprobe vivid n_devs=1 node_types=0x1 num_inputs=1 input_types=0x0
//   LIGHTSTAGE_VIDEO_DEVICE=/dev/video0 LIGHTSTAGE_VIDEO_FRAMES_PER_S=10 vm_test_v4l2
//
// That is a webcam, whose rate can be set (it is 2 frames/s otherwise) and which has a few sizes. With input_types=0x3 it is a grabber,
// which cuts regions and scales; its rate is its source's, and the second variable must be left out.
//
// Frames come when they come there: nothing here asserts a rate.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <thread>

#include "drivers/conformance/fixtures.h"
#include "drivers/v4l2/driver.h"
#include "drivers/v4l2/photographer.h"
#include "drivers/v4l2/v4l2_camera.h"
#include "drivers/v4l2/v4l2_device.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// A test that has no device fails.
std::string Node() {
  const char* node = std::getenv("LIGHTSTAGE_VIDEO_DEVICE");
  if (node == nullptr) ADD_FAILURE() << "LIGHTSTAGE_VIDEO_DEVICE must name vivid's capture node";
  return node == nullptr ? "/dev/video-not-given" : node;
}

V4l2Options Options() {
  V4l2Options options;
  options.device = Node();
  if (const char* rate = std::getenv("LIGHTSTAGE_VIDEO_FRAMES_PER_S")) {
    options.frames_per_s = std::atof(rate);
  }
  options.fixed_exposure =
      milliseconds(10);  // vivid has no control for it; the suite asks for 10 ms
  return options;
}

// The smallest size, for the machine is slow.
CameraConfig Smallest(const Camera& camera, PixelFormat format) {
  return camera.Validate({format, 1, 1, camera.info().min_gain_db}).config;
}

// Descriptors and mappings of the node that this process has.
int Held() {
  int held = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code error;
    held += std::filesystem::read_symlink(entry.path(), error) == Node();
  }
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) held += line.find(Node()) != std::string::npos;
  return held;
}

// vivid's controls, by name, on a descriptor of their own. vivid comes back after a disconnect only when nobody has it open.
class Vivid {
 public:
  Vivid() : fd_(open(Node().c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
    EXPECT_GE(fd_, 0) << std::strerror(errno);
    v4l2_queryctrl query = {};
    query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (fd_ >= 0 && ioctl(fd_, VIDIOC_QUERYCTRL, &query) == 0) {
      ids_[reinterpret_cast<const char*>(query.name)] = query.id;
      query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
  }
  ~Vivid() {
    if (fd_ >= 0) close(fd_);
  }
  void Set(const std::string& name, int value = 1) {
    ASSERT_EQ(ids_.count(name), 1u) << "there is no control '" << name << "'";
    v4l2_control control = {ids_[name], value};
    ASSERT_EQ(ioctl(fd_, VIDIOC_S_CTRL, &control), 0) << name << ": " << std::strerror(errno);
  }
  // An entry of a menu, by its text.
  void Choose(const std::string& name, const std::string& entry) {
    for (uint32_t i = 0; i < 64; ++i) {
      v4l2_querymenu menu = {};
      menu.id = ids_[name];
      menu.index = i;
      if (ioctl(fd_, VIDIOC_QUERYMENU, &menu) != 0) continue;
      if (entry == reinterpret_cast<const char*>(menu.name)) return Set(name, static_cast<int>(i));
    }
    FAIL() << "'" << name << "' has no '" << entry << "'";
  }

 private:
  const int fd_;
  std::map<std::string, uint32_t> ids_;
};

// ---- Conformance

class VividFixture : public CameraFixture {
 public:
  explicit VividFixture(std::optional<Duration> latency) : latency_(latency) {}
  ~VividFixture() override { EXPECT_EQ(Held(), 0); }
  Clock& clock() override { return clock_; }
  absl::StatusOr<std::unique_ptr<Camera>> Open() override {
    V4l2Options options = Options();
    options.latency = latency_;
    absl::StatusOr<std::unique_ptr<Camera>> camera =
        V4l2Camera::Open(V4l2System::Instance(), options, {"camera", &clock_, nullptr});
    if (camera.ok()) smallest_ = Smallest(**camera, (*camera)->info().formats.front());
    return camera;
  }
  CameraConfig config(const CameraInfo&) const override { return smallest_; }
  Duration patience() const override { return seconds(60); }

 private:
  const std::optional<Duration> latency_;
  RealClock clock_;
  CameraConfig smallest_;
};

[[maybe_unused]] const bool kConformance =
    RegisterCameraConformance("Vivid", [] { return std::make_unique<VividFixture>(std::nullopt); });
[[maybe_unused]] const bool kConformanceWithLatency = RegisterCameraConformance(
    "VividWithLatency", [] { return std::make_unique<VividFixture>(milliseconds(20)); });

// ---- Faults

class VividTest : public testing::Test {
 protected:
  void SetUp() override {
    {
      Vivid vivid;
      vivid.Set("Percentage of Dropped Buffers", 0);
      vivid.Set("Wrap Sequence Number", 0);
    }
    Open();
    if (HasFatalFailure()) return;
    const absl::Status ready = photographer_->Ready(config_);
    ASSERT_TRUE(ready.ok()) << ready;
  }
  void TearDown() override {
    camera_.reset();
    EXPECT_EQ(Held(), 0);
  }
  void Open() {
    auto camera = V4l2Camera::Open(V4l2System::Instance(), Options(), {"camera", &clock_, nullptr});
    ASSERT_TRUE(camera.ok()) << camera.status();
    camera_ = *std::move(camera);
    config_ = Smallest(*camera_, camera_->info().formats.front());
    photographer_ = std::make_unique<Photographer>(clock_, *camera_);
  }
  absl::StatusOr<Frame> Take(Duration patience = seconds(60)) {
    return photographer_->Take(milliseconds(10), patience);
  }
  // Does `fault` over and over while a frame is taken, until one fails; what it failed with.
  absl::Status TakeWhile(const std::function<void()>& fault) {
    absl::Status status;
    for (int i = 0; i < 20 && status.ok(); ++i) {
      Pending<Frame> frame(clock_);
      camera_->Trigger(
          milliseconds(10), clock_.Now() + seconds(60), [](absl::StatusOr<ExposureEnd>) {},
          frame.sink());
      while (!frame.done()) {
        fault();
        SleepFor(clock_, milliseconds(2));
      }
      status = frame.Wait(kNever, "the frame").status();
    }
    return status;
  }

  RealClock clock_;
  std::unique_ptr<Camera> camera_;
  CameraConfig config_;
  std::unique_ptr<Photographer> photographer_;
};

double Mean(const Frame& frame) {
  double sum = 0;
  const int bytes = BytesPerSample(frame.format);
  for (size_t i = 0; i + bytes <= frame.data.size(); i += bytes) {
    int value = static_cast<int>(frame.data[i]);
    if (bytes == 2) value |= static_cast<int>(frame.data[i + 1]) << 8;
    sum += value;
  }
  return sum / (static_cast<double>(frame.data.size()) / bytes) /
         ((1 << frame.significant_bits) - 1);
}

TEST_F(VividTest, BlackIsBlackAndWhiteIsWhiteInEveryFormat) {
  for (PixelFormat format : camera_->info().formats) {
    ASSERT_TRUE(photographer_->Disarm().ok());
    double mean[2];
    for (int white : {0, 1}) {
      Vivid vivid;
      vivid.Choose("OSD Text Mode", "None");
      vivid.Choose("Test Pattern", white == 1 ? "100% White" : "100% Black");
      const absl::Status ready = photographer_->Ready(Smallest(*camera_, format));
      ASSERT_TRUE(ready.ok()) << ready;
      const absl::StatusOr<Frame> frame = Take();
      ASSERT_TRUE(frame.ok()) << frame.status();
      mean[white] = Mean(*frame);
      ASSERT_TRUE(photographer_->Disarm().ok());
    }
    EXPECT_LT(mean[0], 0.1) << PixelFormatName(format);
    EXPECT_GT(mean[1], 0.85) << PixelFormatName(format);
    EXPECT_LE(mean[1], 1) << PixelFormatName(format);
  }
}

TEST_F(VividTest, DroppedBuffersAreWaitedFor) {
  Vivid().Set("Percentage of Dropped Buffers", 50);
  uint64_t last = 0;
  for (int i = 0; i < 5; ++i) {
    const absl::StatusOr<Frame> frame = Take();
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_GT(frame->sequence, last);
    last = frame->sequence;
  }
}

TEST_F(VividTest, AStreamWithoutFramesIsSilentAndBeginsAnew) {
  Vivid().Set("Percentage of Dropped Buffers", 100);
  SleepFor(clock_, milliseconds(500));
  const absl::Status silent = Take(seconds(2)).status();
  EXPECT_EQ(ErrorReason(silent), "DEVICE_SILENT") << silent;
  Vivid().Set("Percentage of Dropped Buffers", 0);
  const absl::StatusOr<Frame> after = Take();
  EXPECT_TRUE(after.ok()) << after.status();
}

TEST_F(VividTest, DamagedFramesAreIncomplete) {
  {
    Vivid vivid;
    const absl::Status damaged = TakeWhile([&] { vivid.Set("Inject V4L2_BUF_FLAG_ERROR"); });
    EXPECT_EQ(ErrorReason(damaged), "FRAME_INCOMPLETE") << damaged;
  }
  absl::StatusOr<Frame> after = Take();
  if (!after.ok()) after = Take();  // the last button may still have been waiting
  EXPECT_TRUE(after.ok()) << after.status();
}

TEST_F(VividTest, AFatalErrorIsAFaultAndTheStreamBeginsAnew) {
  {
    Vivid vivid;
    const absl::Status broken = TakeWhile([&] { vivid.Set("Inject Fatal Streaming Error"); });
    EXPECT_EQ(ErrorReason(broken), "DEVICE_FAULT") << broken;
  }
  const absl::StatusOr<Frame> after = Take();
  EXPECT_TRUE(after.ok()) << after.status();
}

TEST_F(VividTest, AStreamThatDoesNotBeginIsAFault) {
  for (const char* error : {"Inject VIDIOC_STREAMON Error", "Inject VIDIOC_REQBUFS Error",
                            "Inject VIDIOC_QBUF Error"}) {
    ASSERT_TRUE(photographer_->Disarm().ok());
    Vivid().Set(error);
    const absl::Status armed = photographer_->Arm().status();
    EXPECT_EQ(ErrorReason(armed), "DEVICE_FAULT") << error << ": " << armed;
    const absl::Status again = photographer_->Arm().status();
    ASSERT_TRUE(again.ok()) << error << ": " << again;
    const absl::StatusOr<Frame> frame = Take();
    EXPECT_TRUE(frame.ok()) << error << ": " << frame.status();
  }
}

TEST_F(VividTest, NumbersMayWrap) {
  ASSERT_TRUE(photographer_->Disarm().ok());
  Vivid().Set("Wrap Sequence Number", 1);
  ASSERT_TRUE(photographer_->Arm().ok());
  uint64_t last = 0;
  // vivid begins 128 before the wrap.
  for (int i = 0; i < 40; ++i) {
    const absl::StatusOr<Frame> frame = Take();
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_GT(frame->sequence, last);
    last = frame->sequence;
  }
  Vivid().Set("Wrap Sequence Number", 0);
}

TEST_F(VividTest, ADisconnectedCameraIsLostAndComesBack) {
  for (bool in_a_shot : {true, false}) {
    TimePoint gone{};
    absl::Status lost;
    if (in_a_shot) {
      Pending<Frame> frame(clock_);
      camera_->Trigger(
          milliseconds(10), clock_.Now() + seconds(60), [](absl::StatusOr<ExposureEnd>) {},
          frame.sink());
      Vivid().Set("Disconnect");
      gone = clock_.Now();
      lost = frame.Wait(clock_.Now() + seconds(90), "the frame").status();
      if (lost.ok()) lost = Take().status();  // it was faster
    } else {
      Vivid().Set("Disconnect");
      gone = clock_.Now();
      lost = Take().status();
    }
    EXPECT_EQ(ErrorReason(lost), "DEVICE_LOST") << lost;
    EXPECT_LT(clock_.Now() - gone, seconds(20));  // far before its deadline
    EXPECT_EQ(Held(), 0);
    ASSERT_TRUE(photographer_->Disarm().ok());
    const absl::Status ready = photographer_->Ready(config_);
    ASSERT_TRUE(ready.ok()) << ready;
    const absl::StatusOr<Frame> after = Take();
    EXPECT_TRUE(after.ok()) << after.status();
  }
}

TEST_F(VividTest, ACameraThatStreamsElsewhereIsBusy) {
  RealClock clock;
  const absl::Status busy =
      V4l2Camera::Open(V4l2System::Instance(), Options(), {"second", &clock, nullptr}).status();
  EXPECT_EQ(ErrorReason(busy), "DEVICE_BUSY") << busy;
  const absl::StatusOr<Frame> frame = Take();
  EXPECT_TRUE(frame.ok()) << frame.status();
}

TEST_F(VividTest, IsDiscovered) {
  const absl::StatusOr<std::vector<Discovered>> found = V4l2Discovery()();
  ASSERT_TRUE(found.ok()) << found.status();
  const auto here = std::find_if(found->begin(), found->end(), [](const Discovered& d) {
    return d.what.find(Node()) != std::string::npos;
  });
  ASSERT_NE(here, found->end());
  EXPECT_NE(here->what.find("vivid"), std::string::npos) << here->what;
  EXPECT_NE(here->toml.find("driver = \"v4l2\""), std::string::npos) << here->toml;
}

// The kernel's stamps are on the rig's clock: no frame ended before it was asked for, or in the future.
TEST_F(VividTest, TimesAreOnTheRigsClock) {
  const TimePoint before = clock_.Now();
  const absl::StatusOr<Frame> frame = Take();
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_GE(frame->exposure_end, before);
  EXPECT_LE(frame->exposure_end, clock_.Now());
  EXPECT_GT(TimePoint(Duration(frame->device_timestamp_ns)), before - seconds(60));
}

}  // namespace
}  // namespace lightstage
