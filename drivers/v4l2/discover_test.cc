#include "drivers/v4l2/discover.h"

#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <cerrno>

#include "drivers/v4l2/fake_system.h"
#include "drivers/v4l2/options.h"

namespace lightstage {
namespace {

TEST(Discover, TellsEveryCameraThatCaptures) {
  FakeSetup webcam;
  webcam.card = "HD \"Pro\" Webcam";
  webcam.formats = {{V4L2_PIX_FMT_MJPEG, {{1920, 1080}, {640, 480}}},
                    {V4L2_PIX_FMT_YUYV, {{1280, 720}, {640, 480}}}};
  webcam.controls = {{V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 3, 2047, 1, 250},
                     {V4L2_CID_GAIN, "Gain", 0, 255, 1, 0}};
  FakeSetup metadata = webcam;
  metadata.metadata_node = true;
  FakeSetup sensor;
  sensor.card = "unicam";
  sensor.bus_info = "platform:fe801000.csi";
  sensor.formats = {{V4L2_PIX_FMT_SRGGB10P, {{3280, 2464}}}};
  sensor.controls = {{V4L2_CID_EXPOSURE, "Exposure", 4, 1759, 1, 1600}};
  FakeSetup planar = sensor;
  planar.multi_planar = true;
  FakeCamera cameras[] = {FakeCamera(webcam), FakeCamera(metadata), FakeCamera(sensor),
                          FakeCamera(planar)};
  FakeVideoSystem system;
  for (int i = 0; i < 4; ++i) system.Add("/dev/video" + std::to_string(i), &cameras[i]);
  system.Add("/dev/video7", nullptr);
  system.Refuse("/dev/video7", EACCES);

  const absl::StatusOr<std::vector<Discovered>> found = DiscoverVideo(system);
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 4u);
  EXPECT_EQ((*found)[0].what,
            "HD \"Pro\" Webcam (usb-0000:00:14.0-1) at /dev/video0: MJPG 1920x1080 640x480; "
            "YUYV 1280x720 640x480;");
  EXPECT_NE((*found)[0].toml.find("format = \"RGB8\"\nwidth = 1280\nheight = 720"),
            std::string::npos)
      << (*found)[0].toml;
  EXPECT_NE((*found)[0].toml.find("300 to 204700 us"), std::string::npos) << (*found)[0].toml;
  EXPECT_NE((*found)[1].toml.find("format = \"BayerRG16\""), std::string::npos);
  EXPECT_NE((*found)[1].toml.find("# exposure_unit_us"), std::string::npos);
  EXPECT_NE((*found)[2].what.find("multi-planar"), std::string::npos);
  EXPECT_NE((*found)[3].what.find("group video"), std::string::npos) << (*found)[3].what;
  for (const FakeCamera& camera : cameras) EXPECT_EQ(camera.open_handles(), 0);

  // What is pasted names this camera.
  absl::StatusOr<TomlDocument> document = TomlDocument::Parse((*found)[0].toml, "rig.toml");
  ASSERT_TRUE(document.ok()) << document.status();
  const V4l2Options options = ParseV4l2Options(document->root().Table("camera").Table("options"));
  EXPECT_EQ(options.card, webcam.card);
  EXPECT_EQ(options.bus_info, webcam.bus_info);
}

TEST(Discover, MotionJpegIsNotOffered) {
  FakeSetup lossy, lossier;
  lossy.formats = {{V4L2_PIX_FMT_MJPEG, {{640, 480}}}};
  lossier.formats = {{V4L2_PIX_FMT_H264, {{640, 480}}}};
  FakeCamera cameras[] = {FakeCamera(lossy), FakeCamera(lossier)};
  FakeVideoSystem system;
  for (int i = 0; i < 2; ++i) system.Add("/dev/video" + std::to_string(i), &cameras[i]);
  const absl::StatusOr<std::vector<Discovered>> found = DiscoverVideo(system);
  ASSERT_TRUE(found.ok()) << found.status();
  ASSERT_EQ(found->size(), 2u);
  EXPECT_NE((*found)[0].toml.find("# fourcc = \"MJPG\""), std::string::npos) << (*found)[0].toml;
  EXPECT_NE((*found)[1].toml.find("not usable"), std::string::npos) << (*found)[1].toml;
  for (const Discovered& camera : *found)
    EXPECT_EQ(camera.toml.find("driver = \"v4l2\"\nformat"), std::string::npos);
}

TEST(Discover, NothingAtAllIsAnErrorOnlyIfItCouldNotLook) {
  FakeVideoSystem system;
  absl::StatusOr<std::vector<Discovered>> found = DiscoverVideo(system);
  ASSERT_TRUE(found.ok());
  EXPECT_TRUE(found->empty());
  system.Add("/dev/video0", nullptr);
  system.Refuse("/dev/video0", EACCES);
  found = DiscoverVideo(system);
  EXPECT_EQ(ErrorReason(found.status()), "DEVICE_PERMISSION") << found.status();
}

TEST(Discover, NamesAreQuotedWhateverIsInThem) {
  EXPECT_EQ(TomlString("a\"b\\c\n\xe9\x7f"), "\"a\\\"b\\\\c\\u000A\\u00E9\\u007F\"");
}

}  // namespace
}  // namespace lightstage
