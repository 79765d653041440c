#include "bench/video.h"

#include <linux/videodev2.h>

#include <utility>
#include <vector>

#include "bench/video_system.h"
#include "drivers/v4l2/v4l2_camera.h"

namespace lightstage::bench {
namespace {

// An ioctl as it was called: its argument, as it went in.
struct Noted {
  unsigned long request = 0;
  std::vector<std::byte> argument;
};

class NotingDevice final : public ForwardingDevice {
 public:
  NotingDevice(std::unique_ptr<VideoDevice> device, std::vector<Noted>& noted)
      : ForwardingDevice(std::move(device)), noted_(noted) {}
  int Ioctl(unsigned long request, void* argument) override {
    const auto* const bytes = static_cast<const std::byte*>(argument);
    noted_.push_back({request, {bytes, bytes + _IOC_SIZE(request)}});
    return ForwardingDevice::Ioctl(request, argument);
  }

 private:
  std::vector<Noted>& noted_;
};

absl::StatusOr<std::shared_ptr<Camera>> OpenCamera(Stage& stage, VideoSystem& system,
                                                   const std::string& node) {
  V4l2Options options;
  options.device = node;
  options.fixed_exposure = std::chrono::milliseconds(1);
  return V4l2Camera::Open(system, options, stage.Context("camera"));
}

Call Configures(Stage& stage, std::shared_ptr<Camera> camera) {
  return [&stage, camera = std::move(camera)] {
    const CameraConfig config = {PixelFormat::kMono8, 640, 360, camera->info().min_gain_db};
    return Await<CameraConfig>(stage, [&](TimePoint deadline, Completion<CameraConfig> done) {
      camera->Configure(config, deadline, std::move(done));
    });
  };
}

}  // namespace

absl::Status MeasureV4l2(Stage& stage, const std::string& node) {
  // What the command is in ioctls is noted once.
  TalliedSystem<NotingDevice, std::vector<Noted>> system;
  {
    ASSIGN_OR_RETURN(std::shared_ptr<Camera> camera, OpenCamera(stage, system, node));
    system.tally.clear();
    RETURN_IF_ERROR(Configures(stage, camera)());
  }
  const std::vector<Noted> configure = std::exchange(system.tally, {});
  const std::string command = absl::StrCat("Configure, ", configure.size(), " ioctls");
  return stage.Print(
      {.driver = "v4l2, vivid",
       .command = command.c_str(),
       .calls = 100,
       .through_driver = [&]() -> absl::StatusOr<Call> {
         ASSIGN_OR_RETURN(auto camera, OpenCamera(stage, V4l2System::Instance(), node));
         return Configures(stage, std::move(camera));
       },
       .bare = [&]() -> absl::StatusOr<Call> {
         std::unique_ptr<VideoDevice> opened;
         if (const int error = V4l2System::Instance().Open(node, &opened); error != 0) {
           return ErrnoError(error, "opening", node);
         }
         std::shared_ptr<VideoDevice> device = std::move(opened);
         return [device, &configure] {
           for (const Noted& noted : configure) {
             std::vector<std::byte> argument = noted.argument;
             // What the driver tries may be refused: it is the same here.
             (void)device->Ioctl(noted.request, argument.data());
           }
           return absl::OkStatus();
         };
       }});
}

}  // namespace lightstage::bench
