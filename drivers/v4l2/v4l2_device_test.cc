// What of the kernel's side can be seen without a camera; the rest is vm_test_v4l2's.
#include "drivers/v4l2/v4l2_device.h"

#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "drivers/v4l2/describe.h"
#include "drivers/v4l2/driver.h"
#include "drivers/v4l2/waker.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(V4l2Device, WhatIsNoVideoDeviceIsSaidToBeNone) {
  absl::StatusOr<VideoPort> port = VideoPort::Open(V4l2System::Instance(), "/dev/null", "camera");
  ASSERT_TRUE(port.ok()) << port.status();
  const absl::Status described = DescribeVideo(*port).status();
  EXPECT_EQ(ErrorReason(described), "DEVICE_UNSUITABLE") << described;
  EXPECT_NE(described.message().find("/dev/null"), std::string_view::npos) << described;
  port = VideoPort::Open(V4l2System::Instance(), "/dev/video-none", "camera");
  EXPECT_EQ(ErrorReason(port.status()), "DEVICE_NOT_FOUND") << port.status();
}

TEST(V4l2Device, WaitsEndWhenWoken) {
  std::unique_ptr<VideoDevice> device;
  // A terminal that nobody writes to.
  ASSERT_EQ(V4l2Device::Open("/dev/ptmx", &device), 0);
  Waker waker;
  ASSERT_GE(waker.fd(), 0);
  EXPECT_EQ(device->Wait(milliseconds(1), waker.fd()), VideoDevice::Readiness::kNothing);
  waker.Wake();
  RealClock clock;
  const TimePoint before = clock.Now();
  EXPECT_EQ(device->Wait(seconds(50), waker.fd()), VideoDevice::Readiness::kNothing);
  EXPECT_LT(clock.Now() - before, seconds(40));
  waker.Clear();
  EXPECT_EQ(device->Wait(milliseconds(1), waker.fd()), VideoDevice::Readiness::kNothing);
}

TEST(V4l2Device, WhoHasANodeIsNamed) {
  const std::string path =
      std::filesystem::temp_directory_path() / ("v4l2_device_test." + std::to_string(getpid()));
  std::ofstream file(path);
  ASSERT_TRUE(file.is_open());
  EXPECT_EQ(ProcessesWithFile("/proc", path, getpid()), "");
  const std::string holders = ProcessesWithFile("/proc", path, /*self=*/0);
  EXPECT_NE(holders.find("(process " + std::to_string(getpid()) + ")"), std::string::npos)
      << holders;
  file.close();
  EXPECT_EQ(ProcessesWithFile("/proc", path, 0), "");
  std::filesystem::remove(path);
  EXPECT_EQ(ProcessesWithFile("/proc", path, 0), "");
}

TEST(V4l2Driver, RefusesARigFileAtItsKeys) {
  absl::StatusOr<TomlDocument> document =
      TomlDocument::Parse("[camera]\ndevice = \"/dev/video-none\"\nbufers = 3\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  V4l2Driver().parse(document->root().Table("camera"));
  const absl::Status status = document->Finish();
  EXPECT_NE(status.message().find("rig.toml:3"), std::string_view::npos) << status;
}

TEST(V4l2Driver, OpensWhatTheRigFileSays) {
  absl::StatusOr<TomlDocument> document =
      TomlDocument::Parse("[camera]\ndevice = \"/dev/video-none\"\n", "rig.toml");
  ASSERT_TRUE(document.ok());
  Driver<Camera> driver = V4l2Driver();
  EXPECT_FALSE(driver.on_virtual_time);
  DeviceOpener<Camera> open = driver.parse(document->root().Table("camera"));
  ASSERT_TRUE(document->Finish().ok());
  RealClock clock;
  const absl::Status opened = open({"camera", &clock, nullptr}).status();
  EXPECT_EQ(ErrorReason(opened), "DEVICE_NOT_FOUND") << opened;
  EXPECT_NE(opened.message().find("/dev/video-none"), std::string_view::npos) << opened;
}

TEST(V4l2Driver, DiscoveryIsQuietWhereThereIsNothing) {
  const absl::StatusOr<std::vector<Discovered>> found = V4l2Discovery()();
  EXPECT_TRUE(found.ok() || !V4l2System::Instance().Paths().empty()) << found.status();
}

}  // namespace
}  // namespace lightstage
