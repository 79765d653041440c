// What the drivers add to their wires: commands of the devices' contracts, from the call until their completion, through each driver and
// the simulated device at the other end (sim/peers), against the same exchanges on the same wire without the driver, or what the line
// itself needs. Usage: command_bench [--can INTERFACE] [--hid] [--video NODE]
//
// Without arguments it measures what every machine has. Else these alone, through the kernel and not within the process:
//   --can INTERFACE   CANopen on this interface (vcan)
//   --hid             a DLPC350 that is a HID device of this machine (uhid)
//   --video NODE      a camera of the kernel (vivid)

#include <arv.h>
#include <spdlog/spdlog.h>

#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "base/memory.h"
#include "bench/buses.h"
#include "bench/stage.h"
#include "bench/video.h"
#include "drivers/aravis/driver.h"
#include "drivers/conformance/private_network.h"
#include "drivers/display/driver.h"
#include "sim/peers/display/xvfb_process.h"
#include "sim/peers/dlpc350/in_process_port.h"
#include "sim/peers/dlpc350/uhid_device.h"
#include "sim/peers/gige/camera_server.h"

namespace lightstage::bench {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

// ---- DLPC350

// Messages as the driver sent them, each with how many reports answered it.
struct Exchange {
  std::vector<dlpc350::Report> message;
  int replies = 0;
};

// Notes what goes through it.
class NotingPort final : public dlpc350::HidPort {
 public:
  NotingPort(std::unique_ptr<dlpc350::HidPort> port, std::vector<Exchange>& noted)
      : port_(std::move(port)), noted_(noted) {}
  const std::string& serial() const override { return port_->serial(); }
  absl::Status Write(const dlpc350::Report& report) override {
    if (noted_.empty() || noted_.back().replies > 0) noted_.emplace_back();
    noted_.back().message.push_back(report);
    return port_->Write(report);
  }
  absl::StatusOr<std::vector<uint8_t>> Read(Duration patience) override {
    ASSIGN_OR_RETURN(std::vector<uint8_t> report, port_->Read(patience));
    if (!report.empty()) ++noted_.back().replies;
    return report;
  }

 private:
  const std::unique_ptr<dlpc350::HidPort> port_;
  std::vector<Exchange>& noted_;
};

absl::Status Repeat(dlpc350::HidPort& port, const std::vector<Exchange>& exchanges) {
  for (const Exchange& exchange : exchanges) {
    for (const dlpc350::Report& report : exchange.message) RETURN_IF_ERROR(port.Write(report));
    for (int i = 0; i < exchange.replies; ++i) {
      ASSIGN_OR_RETURN(const std::vector<uint8_t> reply, port.Read(seconds(5)));
      if (reply.empty()) return absl::DeadlineExceededError("no reply from the projector");
    }
  }
  return absl::OkStatus();
}

absl::Status MeasureDlpc350(Stage& stage, bool hid) {
  Pattern full;
  full.arrangement = PatternArrangement::kFull;
  dlpc350::Options options;
  options.flash = true;
  options.current = {50, 60, 70};
  options.exposure_us = options.period_us = 8400;
  options.patterns[full] = {0, 24, 1, false};
  sim::Dlpc350Device device(stage.world, {{sim::FlashPlace(0, 24, 1), full}});
  std::unique_ptr<sim::UhidDevice> plugged;
  dlpc350::HidOpener port = sim::InProcessHid(device, "BENCH1");
  if (hid) {
    ASSIGN_OR_RETURN(plugged, sim::UhidDevice::Plug(device, "BENCH1"));
    port = [] { return dlpc350::OpenHidDevice("", "BENCH1"); };
  }
  auto open = [&](const dlpc350::HidOpener& opener) {
    return OpenLinkedProjector(
        stage.Context("projector"), "dlpc350",
        std::make_unique<dlpc350::Link>(stage.Context("projector"), options, opener, nullptr));
  };
  // What a command is on the wire is noted once.
  std::vector<Exchange> noted, opening;
  auto note = [&](auto command) -> absl::StatusOr<std::vector<Exchange>> {
    noted.clear();
    ASSIGN_OR_RETURN(std::shared_ptr<Projector> projector,
                     open([&]() -> absl::StatusOr<std::unique_ptr<dlpc350::HidPort>> {
                       ASSIGN_OR_RETURN(auto noting, port());
                       return std::make_unique<NotingPort>(std::move(noting), noted);
                     }));
    RETURN_IF_ERROR(Shows(stage, projector)());
    opening = std::exchange(noted, {});
    RETURN_IF_ERROR(command(stage, projector)());
    return std::exchange(noted, {});
  };
  ASSIGN_OR_RETURN(const std::vector<Exchange> show, note(Shows));
  ASSIGN_OR_RETURN(const std::vector<Exchange> check, note(Checks<Projector>));
  auto bare = [&](const std::vector<Exchange>& command) -> absl::StatusOr<Call> {
    ASSIGN_OR_RETURN(std::shared_ptr<dlpc350::HidPort> opened, port());
    RETURN_IF_ERROR(Repeat(*opened, opening));
    return [opened, &command] { return Repeat(*opened, command); };
  };
  const char* const name = hid ? "dlpc350, uhid" : "dlpc350, process";
  RETURN_IF_ERROR(stage.Print({.driver = name,
                               .command = "Projector::Show, flash",
                               .calls = 100,
                               .through_driver = [&]() -> absl::StatusOr<Call> {
                                 ASSIGN_OR_RETURN(auto projector, open(port));
                                 return Shows(stage, std::move(projector));
                               },
                               .bare = [&] { return bare(show); },
                               .line = microseconds(options.period_us)}));
  return stage.Print({.driver = name,
                      .command = "Projector::Check, 5 reads",
                      .through_driver = [&]() -> absl::StatusOr<Call> {
                        ASSIGN_OR_RETURN(std::shared_ptr<Projector> projector, open(port));
                        RETURN_IF_ERROR(Shows(stage, projector)());
                        return Checks(stage, std::move(projector));
                      },
                      .bare = [&] { return bare(check); }});
}

// ---- Display

absl::Status MeasureDisplay(Stage& stage) {
  constexpr int kFrames = 2;
  constexpr double kRefreshHz = 60;  // the server does not tell another
  ASSIGN_OR_RETURN(XvfbProcess server,
                   XvfbProcess::Start({.width = stage.geometry.projector.width,
                                       .height = stage.geometry.projector.height}));
  return stage.Print(
      {.driver = "display, Xvfb",
       .command = "Projector::Show",
       .calls = 60,
       .through_driver = [&]() -> absl::StatusOr<Call> {
         ASSIGN_OR_RETURN(
             std::shared_ptr<Projector> projector,
             Open(stage, DisplayDriver(), "projector",
                  absl::StrCat("output_index = 0\nrenderer = \"software\"\nframes = ", kFrames,
                               "\nx_display = \"", server.display(), "\"\n")));
         return Shows(stage, std::move(projector));
       },
       .line = FromSeconds(kFrames / kRefreshHz)});
}

// ---- GigE Vision

constexpr char kAddress[] = "127.0.0.1";
constexpr int kWidth = 64, kHeight = 48;
constexpr Duration kExposure = milliseconds(1);

absl::StatusOr<Call> TakesFrames(Stage& stage) {
  ASSIGN_OR_RETURN(std::shared_ptr<Camera> camera,
                   Open(stage, AravisDriver(), "camera",
                        absl::StrCat("address = \"", kAddress, "\"\npacket_size = 7000\n")));
  RETURN_IF_ERROR(
      Await<CameraConfig>(stage, [&](TimePoint deadline, Completion<CameraConfig> done) {
        camera->Configure({PixelFormat::kMono8, kWidth, kHeight, camera->info().min_gain_db},
                          deadline, std::move(done));
      }));
  RETURN_IF_ERROR(
      Await<CameraConfig>(stage, [&](TimePoint deadline, Completion<CameraConfig> done) {
        camera->Arm(deadline, std::move(done));
      }));
  return [&stage, camera] {
    return Await<Frame>(stage, [&](TimePoint deadline, Completion<Frame> done) {
      camera->Trigger(
          kExposure, deadline, [](absl::StatusOr<ExposureEnd>) {}, std::move(done));
    });
  };
}

// libaravis and nothing else.
absl::StatusOr<Call> BareAravis() {
  const auto refused = [](GError* error) {
    absl::Status status = absl::UnavailableError(error->message);
    g_error_free(error);
    return status;
  };
  GError* error = nullptr;
  const auto release = [](auto* object) {
    if (object != nullptr) g_object_unref(object);
  };
  std::shared_ptr<ArvCamera> camera(arv_camera_new(kAddress, &error), release);
  if (error == nullptr) arv_camera_gv_set_packet_size(camera.get(), 7000, &error);
  if (error == nullptr) arv_camera_set_region(camera.get(), 0, 0, kWidth, kHeight, &error);
  if (error == nullptr) {
    arv_camera_set_exposure_time(camera.get(), Seconds(kExposure) * 1e6, &error);
  }
  if (error == nullptr) arv_camera_set_trigger(camera.get(), "Software", &error);
  if (error != nullptr) return refused(error);
  arv_camera_gv_set_stream_options(camera.get(), ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  std::shared_ptr<ArvStream> stream(
      arv_camera_create_stream(camera.get(), nullptr, nullptr, &error), release);
  if (error == nullptr) {
    const size_t payload = arv_camera_get_payload(camera.get(), &error);
    for (int i = 0; i < 4; ++i) {
      arv_stream_push_buffer(stream.get(), arv_buffer_new(payload, nullptr));
    }
  }
  if (error == nullptr) arv_camera_start_acquisition(camera.get(), &error);
  if (error != nullptr) return refused(error);
  // The stream goes before its camera, which must be told.
  std::shared_ptr<void> acquisition(
      nullptr, [camera](void*) { arv_camera_stop_acquisition(camera.get(), nullptr); });
  return [camera, stream, acquisition, refused]() -> absl::Status {
    GError* wrong = nullptr;
    arv_camera_software_trigger(camera.get(), &wrong);
    if (wrong != nullptr) return refused(wrong);
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream.get(), 5'000'000);
    if (buffer == nullptr) return absl::DeadlineExceededError("no frame from the camera");
    arv_stream_push_buffer(stream.get(), buffer);
    return absl::OkStatus();
  };
}

absl::Status MeasureAravis(Stage& stage) {
  ASSIGN_OR_RETURN(const auto server,
                   sim::GigeCameraServer::Start(
                       {.address = kAddress, .width = kWidth, .height = kHeight}, stage.world));
  return stage.Print({.driver = "aravis, sim-gige",
                      .command = "Camera::Trigger, frame",
                      .calls = 200,
                      .through_driver = [&] { return TakesFrames(stage); },
                      .bare = BareAravis,
                      .exposure = kExposure});
}

absl::Status Measure(const std::string& can_interface, bool hid, const std::string& video) {
  Stage stage;
  RETURN_IF_ERROR(stage.Build());
  PrintRoundTripHeader();
  if (!can_interface.empty()) RETURN_IF_ERROR(MeasureCanopen(stage, can_interface));
  if (hid) RETURN_IF_ERROR(MeasureDlpc350(stage, hid));
  if (!video.empty()) RETURN_IF_ERROR(MeasureV4l2(stage, video));
  if (hid || !can_interface.empty() || !video.empty()) return absl::OkStatus();
  RETURN_IF_ERROR(MeasureModbus(stage, /*tcp=*/true));
  RETURN_IF_ERROR(MeasureModbus(stage, /*tcp=*/false));
  RETURN_IF_ERROR(MeasureCanopen(stage, ""));
  RETURN_IF_ERROR(MeasureDlpc350(stage, /*hid=*/false));
  RETURN_IF_ERROR(MeasureAravis(stage));
  RETURN_IF_ERROR(MeasureDisplay(stage));
  RETURN_IF_ERROR(MeasureDmx(stage, dmx::WidgetKind::kOpen));
  return MeasureDmx(stage, dmx::WidgetKind::kPro);
}

}  // namespace
}  // namespace lightstage::bench

int main(int argc, char** argv) {
  spdlog::set_level(spdlog::level::err);
  lightstage::KeepFrameMemory();  // as the daemon does
  std::string can_interface, video;
  bool hid = false;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--hid") == 0) {
      hid = true;
    } else if (std::strcmp(argv[i], "--can") == 0 && i + 1 < argc) {
      can_interface = argv[++i];
    } else if (std::strcmp(argv[i], "--video") == 0 && i + 1 < argc) {
      video = argv[++i];
    } else {
      return std::fprintf(stderr,
                          "usage: command_bench [--can INTERFACE] [--hid] [--video NODE]\n"),
             2;
    }
  }
  // GigE Vision's port is fixed; an interface of the kernel is in the network that the machine has.
  if (can_interface.empty()) lightstage::EnterPrivateNetwork();
  absl::Status measured = lightstage::bench::Measure(can_interface, hid, video);
  if (!measured.ok()) std::fprintf(stderr, "%s\n", lightstage::MessageOf(measured).c_str());
  return measured.ok() ? 0 : 1;
}
