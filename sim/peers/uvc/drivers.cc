#include "sim/peers/uvc/drivers.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"
#include "base/status.h"
#include "drivers/link/device_thread.h"
#include "drivers/v4l2/options.h"
#include "drivers/v4l2/v4l2_camera.h"
#include "drivers/v4l2/v4l2_device.h"
#include "sim/peers/uvc/camera_server.h"
#include "sim/peers/uvc/vhci.h"
#include "sim/rig/fault_plan.h"
#include "sim/rig/served.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr char kName[] = "sim-v4l2";

// The camera is what its driver's table says.
UvcCameraOptions ParseCamera(const TomlTable& table, const V4l2Options& driver) {
  UvcCameraOptions options;
  options.product = driver.card;
  constexpr size_t kMostLetters = 31;  // the kernel keeps no more
  if (options.product.empty()) {
    table.ErrorAt("card", "missing; the simulated camera gets it");
  } else if (options.product.size() > kMostLetters ||
             std::any_of(options.product.begin(), options.product.end(),
                         [](char c) { return c < ' ' || c > '~'; })) {
    table.ErrorAt("card", "must be at most 31 characters of ASCII where the camera is simulated");
  }
  if (driver.stamps_at_exposure_start) {
    table.ErrorAt("stamps_at_exposure_start",
                  "must be false where the camera is simulated: its frames are stamped when they "
                  "arrive");
  }
  options.frame_interval = FromSeconds(1 / driver.frames_per_s.value_or(30));
  options.bits = driver.significant_bits.value_or(options.bits);
  if (driver.gain_db_per_step > 0) options.gain_db_per_step = driver.gain_db_per_step;
  const TomlTable peer = table.Table("peer");
  options.latency = peer.Time("latency_ms", 0, 10000, 0.0);
  options.latency_limit = driver.latency;
  if (driver.latency && *driver.latency <= options.latency) {
    table.ErrorAt("latency_ms",
                  absl::StrFormat("must be greater than the %g ms that the simulated camera has "
                                  "(latency_ms of the table peer), for the way to the computer",
                                  Seconds(options.latency) * 1e3));
  }
  options.width = static_cast<int>(peer.Int("sensor_width", 1, 16384, 640));
  options.height = static_cast<int>(peer.Int("sensor_height", 1, 16384, 480));
  return options;
}

// A camera in a port of the machine.
class Plugged {
 public:
  Plugged(const UvcCameraOptions& options, std::shared_ptr<World> world)
      : options_(options), world_(std::move(world)) {}
  ~Plugged() {
    faults_.reset();
    if (absl::Status out = Unplug(); !out.ok()) spdlog::error("{}", MessageOf(out));
  }
  Plugged(const Plugged&) = delete;
  Plugged& operator=(const Plugged&) = delete;

  // Always in the same port, by which its driver knows it.
  absl::Status Plug() {
    ASSIGN_OR_RETURN(const VhciPlug plug, PlugIntoVhci(port_));
    port_ = plug.port;
    server_ = std::make_unique<UvcCameraServer>(options_, world_, plug.socket);
    return absl::OkStatus();
  }
  absl::Status Unplug() {
    if (server_ == nullptr) return absl::OkStatus();
    server_.reset();
    return AwaitVhciPort(*port_);
  }
  void MakeFaults(const std::string& name, const FaultPlanOptions& plan) {
    faults_ = std::make_unique<FaultPlan>(name, plan, Kinds());
  }

 private:
  std::vector<FaultKind> Kinds() {
    const auto fails = [this](const char* name, Duration lasts, UvcFault fault) {
      return FaultKind{name, lasts, [this, fault](bool on) {
                         if (server_ != nullptr) server_->Fail(on ? fault : UvcFault::kNone);
                       }};
    };
    return {fails("goes silent", seconds(1), UvcFault::kSilent),
            fails("damaged frames", milliseconds(500), UvcFault::kDamaged),
            fails("short frames", milliseconds(500), UvcFault::kShort),
            fails("skips frames", milliseconds(500), UvcFault::kSkips),
            fails("stalls its controls", milliseconds(500), UvcFault::kStalls),
            Once("disturbed transfers",
                 [this] {
                   if (server_ != nullptr) server_->BreakTransfers();
                 }),
            {"unplugged", milliseconds(500), [this](bool begins) {
               if (absl::Status done = begins ? Unplug() : Plug(); !done.ok()) {
                 spdlog::error("{}", MessageOf(done));
               }
             }}};
  }

  const UvcCameraOptions options_;
  const std::shared_ptr<World> world_;  // shared with the rig's other devices
  std::optional<int> port_;
  // None while it is unplugged. The faults' thread's, once there is one.
  std::unique_ptr<UvcCameraServer> server_;
  std::unique_ptr<FaultPlan> faults_;
};

// The kernel takes its time with a device that was plugged in.
absl::StatusOr<std::unique_ptr<Camera>> OpenOnceThere(const V4l2Options& options,
                                                      const DeviceContext& context) {
  const TimePoint give_up = context.clock->Now() + seconds(10);
  while (true) {
    absl::StatusOr<std::unique_ptr<Camera>> camera =
        V4l2Camera::Open(V4l2System::Instance(), options, context);
    if (!absl::IsNotFound(camera.status())) return camera;
    if (context.clock->Now() > give_up) {
      return Error(absl::StatusCode::kUnavailable, "PEER_NOT_STARTED",
                   absl::StrCat(MessageOf(camera.status()),
                                ": the simulated USB camera's node did not appear (modprobe "
                                "uvcvideo)"),
                   {{"device", context.name}});
    }
    SleepFor(*context.clock, milliseconds(50));
  }
}

DeviceOpener<Camera> ParseUvc(const std::shared_ptr<Simulation>& simulation,
                              const TomlTable& table) {
  const V4l2Options driver = ParseV4l2Options(table);
  return [simulation, driver, options = ParseCamera(table, driver),
          plan = ParseFaultPlan(table.Table("peer"))](
             const DeviceContext& context) -> absl::StatusOr<std::unique_ptr<Camera>> {
    RETURN_IF_ERROR(DeviceThread::CheckClock(context));
    ASSIGN_OR_RETURN(std::shared_ptr<World> world,
                     simulation->OpenWorld(*context.geometry, *context.clock));
    if (absl::Status fits = world->CheckFilm({options.width, options.height}); !fits.ok()) {
      return Annotate(fits, context.name);
    }
    auto plugged = std::make_shared<Plugged>(options, std::move(world));
    RETURN_IF_ERROR(Annotate(plugged->Plug(), context.name));
    ASSIGN_OR_RETURN(std::unique_ptr<Camera> camera, OpenOnceThere(driver, context));
    plugged->MakeFaults(context.name, plan);
    return std::make_unique<ServedCamera>(std::move(plugged), std::move(camera), kName);
  };
}

}  // namespace

void RegisterUvcPeer(DriverRegistry& registry, const std::shared_ptr<Simulation>& simulation) {
  registry.cameras[kName].parse = [simulation](const TomlTable& table) {
    return ParseUvc(simulation, table);
  };
}

}  // namespace lightstage::sim
