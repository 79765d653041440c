// The simulated rig's picture through a real GigE Vision stream: served by Aravis' fake camera, taken by the aravis driver.
#include <gtest/gtest.h>

#include <cstring>
#include <numeric>
#include <optional>

#include "absl/strings/str_format.h"
#include "drivers/aravis/driver.h"
#include "drivers/conformance/fixtures.h"
#include "drivers/conformance/private_network.h"
#include "sim/peers/gige/camera_server.h"
#include "sim/peers/gige/drivers.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

[[maybe_unused]] const bool kPrivateNetwork = EnterPrivateNetwork();

constexpr int kWidth = 64, kHeight = 48;

RigGeometry Geometry() {
  RigGeometry geometry;
  geometry.brace.radius = Meters(1);
  geometry.brace.lamp_radius = Meters(0.02);
  geometry.brace.lamps = {{Degrees(0), Degrees(30)}, {Degrees(90), Degrees(60)}};
  geometry.camera.position = Vec3(0.8, 0, 0.5);
  geometry.camera.look_at = Vec3(0, 0, 0.05);
  geometry.camera.field_of_view = Degrees(25);
  return geometry;
}

// One process may hold one such camera: what the rig file would say, opened.
class Rig {
 public:
  absl::Status Open(const std::string& simulation_keys,
                    const std::string& peer_keys = "bits = 12\n",
                    const std::string& camera_keys = "") {
    simulation_ = RegisterSimulatedDrivers(registry_);
    RegisterGigePeer(registry_, simulation_);
    ASSIGN_OR_RETURN(TomlDocument document,
                     TomlDocument::Parse("[simulation]\nsamples = 1\n" + simulation_keys +
                                             "[camera]\naddress = \"127.0.0.1\"\n"
                                             "packet_size = 7000\nframe_retention_ms = 100\n" +
                                             camera_keys +
                                             "[camera.peer]\nsensor_width = 64\n"
                                             "sensor_height = 48\n" +
                                             peer_keys,
                                         "rig.toml"));
    registry_.tables.at("simulation")(document.root().Table("simulation"));
    DeviceOpener<Camera> open =
        registry_.cameras.at("sim-gige").parse(document.root().Table("camera"));
    RETURN_IF_ERROR(document.Finish());
    ASSIGN_OR_RETURN(world_, simulation_->OpenWorld(geometry_, clock_));
    ASSIGN_OR_RETURN(camera_, open({"camera", &clock_, &geometry_}));
    return absl::OkStatus();
  }

  void Light(float first, float second, TimePoint at) {
    world_->RampLamps(at, {}, {}, {first, second});
  }

  absl::Status Ready(const CameraConfig& config) {
    Pending<CameraConfig> configured(clock_), armed(clock_);
    camera_->Configure(config, Soon(), configured.sink());
    RETURN_IF_ERROR(configured.Wait(Soon(), "Configure").status());
    camera_->Arm(Soon(), armed.sink());
    return armed.Wait(Soon(), "Arm").status();
  }

  // Retaken if packets were lost: the machine may be busy, and this peer sends none twice.
  absl::StatusOr<Frame> Take(Duration exposure) {
    absl::StatusOr<Frame> frame = absl::UnknownError("not taken");
    for (int i = 0; i < 5; ++i) {
      Pending<ExposureEnd> ended(clock_);
      Pending<Frame> pending(clock_);
      camera_->Trigger(exposure, Soon(), ended.sink(), pending.sink());
      frame = pending.Wait(Soon(), "the frame");
      if (!absl::IsDataLoss(frame.status())) break;
    }
    return frame;
  }

  TimePoint Soon() { return clock_.Now() + seconds(60); }
  Clock& clock() { return clock_; }
  World& world() { return *world_; }
  Camera& camera() { return *camera_; }
  std::unique_ptr<Camera> TakeCamera() { return std::move(camera_); }

 private:
  RealClock clock_;
  RigGeometry geometry_ = Geometry();
  DriverRegistry registry_;
  std::shared_ptr<Simulation> simulation_;
  std::shared_ptr<World> world_;
  std::unique_ptr<Camera> camera_;
};

constexpr char kNoNoise[] = "[simulation.sensor]\nphoton_noise = false\nread_noise_e = 0\n";

// ---- Conformance, with exposures that really last

class GigeFixture : public CameraFixture {
 public:
  explicit GigeFixture(std::string peer_keys) : peer_keys_(std::move(peer_keys)) {}
  Clock& clock() override { return rig_.clock(); }
  absl::StatusOr<std::unique_ptr<Camera>> Open() override {
    RETURN_IF_ERROR(rig_.Open(kNoNoise, peer_keys_));
    return rig_.TakeCamera();
  }
  int retakes() const override { return 5; }

 private:
  const std::string peer_keys_;
  Rig rig_;
};

[[maybe_unused]] const bool kConformance = RegisterCameraConformance(
    "SimGige", [] { return std::make_unique<GigeFixture>("bits = 12\n"); });
[[maybe_unused]] const bool kConformanceWithChunks =
    RegisterCameraConformance("SimGigeWithChunks", [] {
      return std::make_unique<GigeFixture>("bits = 10\npacking = \"p\"\nchunk_data = true\n");
    });

// ---- The picture

TEST(SimGige, TellsItsSensor) {
  Rig rig;
  ASSERT_TRUE(rig.Open(kNoNoise).ok());
  const CameraInfo& info = rig.camera().info();
  EXPECT_EQ(info.identity.driver, "sim-gige");
  EXPECT_EQ(info.identity.serial, "SIM01");
  EXPECT_EQ(info.sensor_width, kWidth);
  EXPECT_EQ(info.sensor_height, kHeight);
  EXPECT_EQ(info.max_exposure, GigeCameraServer::kMaxExposure);
  EXPECT_EQ(info.exposure_step, std::chrono::microseconds(1));
  EXPECT_EQ(info.formats.size(), 12u) << "all that there are";
}

// Under steady light every format carries the very codes that the simulated sensor read.
TEST(SimGige, FramesEqualTheSimulatedSensors) {
  Rig rig;
  ASSERT_TRUE(rig.Open(kNoNoise).ok());
  rig.Light(1.0f, 0.5f, rig.clock().Now());
  SleepFor(rig.clock(), milliseconds(50));
  constexpr Duration kExposure = milliseconds(20);
  for (PixelFormat format : rig.camera().info().formats) {
    ASSERT_TRUE(rig.Ready({format, kWidth, kHeight, 0}).ok()) << PixelFormatName(format);
    absl::StatusOr<Frame> served = rig.Take(kExposure);
    ASSERT_TRUE(served.ok()) << PixelFormatName(format) << ": " << served.status();
    absl::StatusOr<Frame> direct =
        rig.world().ExposeNow(kExposure, format, {kWidth, kHeight}, /*bits=*/12);
    ASSERT_TRUE(direct.ok()) << direct.status();
    EXPECT_EQ(served->significant_bits, direct->significant_bits);
    EXPECT_EQ(served->exposure, kExposure);
    EXPECT_TRUE(served->data == direct->data) << PixelFormatName(format);
    size_t lit = std::count_if(served->data.begin(), served->data.end(),
                               [](std::byte b) { return b != std::byte{0}; });
    EXPECT_GT(lit, served->data.size() / 20) << "the test's scene is dark";
    Pending<CameraConfig> disarmed(rig.clock());
    rig.camera().Disarm(rig.Soon(), disarmed.sink());
    ASSERT_TRUE(disarmed.Wait(rig.Soon(), "Disarm").ok());
  }
}

// Packed on the wire by the peer, unpacked by the driver: the same samples.
TEST(SimGige, PackedFramesEqualTheSimulatedSensors) {
  for (const auto& [bits, packing] :
       {std::pair{12, "p"}, {12, "Packed"}, {10, "p"}, {10, "Packed"}}) {
    const std::string name = absl::StrCat(bits, packing);
    Rig rig;
    ASSERT_TRUE(rig.Open(kNoNoise, absl::StrFormat("bits = %d\npacking = \"%s\"\n", bits, packing),
                         absl::StrFormat("pixel_format = \"BayerRG%s\"\n", name))
                    .ok());
    EXPECT_EQ(rig.camera().info().formats, std::vector{PixelFormat::kBayerRG16});
    rig.Light(1.0f, 0.5f, rig.clock().Now());
    SleepFor(rig.clock(), milliseconds(50));
    ASSERT_TRUE(rig.Ready({PixelFormat::kBayerRG16, 32, 20, 0}).ok()) << name;
    absl::StatusOr<Frame> served = rig.Take(milliseconds(20));
    ASSERT_TRUE(served.ok()) << name << ": " << served.status();
    absl::StatusOr<Frame> whole =
        rig.world().ExposeNow(milliseconds(20), PixelFormat::kBayerRG16, {kWidth, kHeight}, bits);
    ASSERT_TRUE(whole.ok()) << whole.status();
    EXPECT_EQ(served->significant_bits, bits);
    for (int y = 0; y < 20; ++y) {
      ASSERT_EQ(std::memcmp(served->data.data() + y * 32 * 2,
                            whole->data.data() + ((y + 14) * kWidth + 16) * 2, 32 * 2),
                0)
          << name << ", row " << y;
    }
  }
}

TEST(SimGige, PixelFormatThatTheCameraHasNotNamesThoseItHas) {
  Rig rig;
  absl::Status refused = rig.Open(kNoNoise, "bits = 12\n", "pixel_format = \"Mono10p\"\n");
  EXPECT_EQ(ErrorReason(refused), "DEVICE_UNSUITABLE") << refused;
  EXPECT_NE(refused.message().find("PixelFormat Mono10p is asked for; the camera has Mono8, "),
            std::string_view::npos)
      << refused;
}

TEST(SimGige, RegionIsTheMiddleOfTheSensor) {
  Rig rig;
  ASSERT_TRUE(rig.Open(kNoNoise).ok());
  rig.Light(1.0f, 0.5f, rig.clock().Now());
  SleepFor(rig.clock(), milliseconds(50));
  ASSERT_TRUE(rig.Ready({PixelFormat::kBayerRG16, 32, 20, 0}).ok());
  absl::StatusOr<Frame> served = rig.Take(milliseconds(20));
  ASSERT_TRUE(served.ok()) << served.status();
  absl::StatusOr<Frame> whole = rig.world().ExposeNow(milliseconds(20), PixelFormat::kBayerRG16,
                                                      {kWidth, kHeight}, /*bits=*/12);
  ASSERT_TRUE(whole.ok()) << whole.status();
  for (int y = 0; y < 20; ++y) {
    ASSERT_EQ(std::memcmp(served->data.data() + y * 32 * 2,
                          whole->data.data() + ((y + 14) * kWidth + 16) * 2, 32 * 2),
              0)
        << "row " << y;
  }
}

double Sum(const Frame& frame) {
  double sum = 0;
  for (size_t i = 0; i < frame.data.size(); i += 2) {
    sum += static_cast<int>(frame.data[i]) + 256 * static_cast<int>(frame.data[i + 1]);
  }
  return sum;
}

// The exposure integrates the light of its own time: one that goes out half-way gives about half the picture, and exposure_ended is
// not called while the sensor still gathers light.
TEST(SimGige, ExposureSeesLightGoOut) {
  Rig rig;
  // Far from saturation, so that codes are proportional to light.
  ASSERT_TRUE(rig.Open(std::string(kNoNoise) + "sensitivity_e = 1e4\n").ok());
  ASSERT_TRUE(rig.Ready({PixelFormat::kMono16, kWidth, kHeight, 0}).ok());
  constexpr Duration kExposure = milliseconds(800);
  rig.Light(1.0f, 1.0f, rig.clock().Now());
  SleepFor(rig.clock(), milliseconds(50));
  absl::StatusOr<Frame> full = rig.Take(kExposure);
  ASSERT_TRUE(full.ok()) << full.status();
  ASSERT_GT(Sum(*full), 1000);

  absl::StatusOr<Frame> half = absl::DataLossError("not taken");
  // A busy machine may lose packets beyond the camera's resends: such a frame is taken again, as the engine would.
  for (int attempt = 0; attempt < 3 && absl::IsDataLoss(half.status()); ++attempt) {
    rig.Light(1.0f, 1.0f, rig.clock().Now());
    SleepFor(rig.clock(), milliseconds(50));
    Pending<ExposureEnd> ended(rig.clock());
    Pending<Frame> pending(rig.clock());
    TimePoint triggered = rig.clock().Now();
    rig.camera().Trigger(kExposure, rig.Soon(), ended.sink(), pending.sink());
    SleepFor(rig.clock(), kExposure / 2);
    rig.Light(0, 0, rig.clock().Now());
    absl::StatusOr<ExposureEnd> end = ended.Wait(rig.Soon(), "the exposure's end");
    half = pending.Wait(rig.Soon(), "the frame");
    ASSERT_TRUE(end.ok()) << end.status();
    EXPECT_GE(end->time, triggered + kExposure);
  }
  ASSERT_TRUE(half.ok()) << half.status();
  double share = Sum(*half) / Sum(*full);
  EXPECT_GT(share, 0.1);
  EXPECT_LT(share, 0.9);

  absl::StatusOr<Frame> dark = rig.Take(milliseconds(10));
  ASSERT_TRUE(dark.ok()) << dark.status();
  EXPECT_EQ(Sum(*dark), 0);
}

// ---- Lines and chunk data: the server in the test's hand, the driver beside it

class Wired {
 public:
  absl::Status Open(const std::string& camera_keys, bool chunk_data = false, int packet_size = 7000,
                    bool exposure_events = false) {
    simulation_ = RegisterSimulatedDrivers(registry_);
    ASSIGN_OR_RETURN(
        TomlDocument document,
        TomlDocument::Parse(absl::StrCat("[simulation]\nsamples = 1\n", kNoNoise, "[camera]\n",
                                         "address = \"127.0.0.1\"\nframe_retention_ms = 100\n",
                                         "lost_after_ms = 10000\n", "packet_size = ", packet_size,
                                         "\n", camera_keys),
                            "rig.toml"));
    registry_.tables.at("simulation")(document.root().Table("simulation"));
    DeviceOpener<Camera> open = AravisDriver().parse(document.root().Table("camera"));
    RETURN_IF_ERROR(document.Finish());
    ASSIGN_OR_RETURN(std::shared_ptr<World> world, simulation_->OpenWorld(geometry_, clock_));
    GigeCameraOptions options;
    options.width = kWidth;
    options.height = kHeight;
    options.chunk_data = chunk_data;
    options.exposure_events = exposure_events;
    ASSIGN_OR_RETURN(server_, GigeCameraServer::Start(options, world));
    ASSIGN_OR_RETURN(camera_, open({"camera", &clock_, &geometry_}));
    return absl::OkStatus();
  }
  absl::Status Ready(double gain_db = 0) {
    Pending<CameraConfig> configured(clock_), armed(clock_);
    camera_->Configure({PixelFormat::kMono8, kWidth, kHeight, gain_db}, In(seconds(30)),
                       configured.sink());
    RETURN_IF_ERROR(configured.Wait(In(seconds(60)), "Configure").status());
    camera_->Arm(In(seconds(30)), armed.sink());
    return armed.Wait(In(seconds(60)), "Arm").status();
  }
  absl::Status Disarm() {
    Pending<CameraConfig> disarmed(clock_);
    camera_->Disarm(In(seconds(30)), disarmed.sink());
    return disarmed.Wait(In(seconds(60)), "Disarm").status();
  }
  // Pulses Line1 after `pulse`, if at all.
  absl::StatusOr<Frame> Take(Duration exposure, std::optional<Duration> pulse = {},
                             Duration patience = seconds(20)) {
    Pending<ExposureEnd> ended(clock_);
    Pending<Frame> frame(clock_);
    camera_->Trigger(exposure, In(patience), ended.sink(), frame.sink());
    if (pulse) {
      SleepFor(clock_, *pulse);
      server_->PulseLine();
    }
    return frame.Wait(In(patience + seconds(30)), "the frame");
  }
  struct Apart {
    TimePoint triggered, ended_at, ended_came, frame_came;
    absl::StatusOr<Frame> frame;
  };
  Apart TakeApart(Duration exposure) {
    Pending<ExposureEnd> ended(clock_);
    Pending<Frame> frame(clock_);
    Apart apart{.triggered = clock_.Now(), .frame = absl::UnknownError("not taken")};
    camera_->Trigger(exposure, In(seconds(20)), ended.sink(), frame.sink());
    const absl::StatusOr<ExposureEnd> end = ended.Wait(In(seconds(30)), "exposure_ended");
    apart.ended_came = clock_.Now();
    if (end.ok()) apart.ended_at = end->time;
    apart.frame = frame.Wait(In(seconds(30)), "the frame");
    apart.frame_came = clock_.Now();
    return apart;
  }
  TimePoint In(Duration time) { return clock_.Now() + time; }
  Clock& clock() { return clock_; }
  GigeCameraServer& server() { return *server_; }

 private:
  RealClock clock_;
  RigGeometry geometry_ = Geometry();
  DriverRegistry registry_;
  std::shared_ptr<Simulation> simulation_;
  std::unique_ptr<GigeCameraServer> server_;
  std::unique_ptr<Camera> camera_;
};

// The frame is the line's, and only while one is asked for.
TEST(SimGigeLines, ALineTriggers) {
  Wired wired;
  absl::Status opened =
      wired.Open("trigger_source = \"Line1\"\ntrigger_activation = \"FallingEdge\"\n");
  ASSERT_TRUE(opened.ok()) << opened;
  ASSERT_TRUE(wired.Ready().ok());
  wired.server().PulseLine();
  absl::StatusOr<Frame> none = wired.Take(milliseconds(10), std::nullopt, milliseconds(400));
  EXPECT_EQ(ErrorReason(none.status()), "DEVICE_SILENT") << "a pulse that nobody waited for counts";
  for (int i = 0; i < 3; ++i) {
    const TimePoint asked = wired.clock().Now();
    absl::StatusOr<Frame> frame = wired.Take(milliseconds(10), milliseconds(500), seconds(10));
    if (absl::IsDataLoss(frame.status())) continue;  // plain UDP on a busy machine
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->exposure, milliseconds(10));
    EXPECT_GE(frame->exposure_start, asked + milliseconds(450));
  }
}

TEST(SimGigeLines, ALinePutsOutTheExposure) {
  Wired wired;
  absl::Status opened = wired.Open("exposure_active_line = \"Line2\"\n");
  ASSERT_TRUE(opened.ok()) << opened;
  EXPECT_TRUE(wired.server().ShowsExposure());
}

// A camera that needs 800 ms to read a frame out: light and motion may go on long before.
TEST(SimGigeEvents, TheEndOfAnExposureIsToldBeforeItsFrame) {
  for (bool event : {true, false}) {
    Wired wired;
    absl::Status opened = wired.Open(event ? "" : "exposure_end_event = false\n",
                                     /*chunk_data=*/false, 7000, /*exposure_events=*/true);
    ASSERT_TRUE(opened.ok()) << opened;
    wired.server().SetReadout(milliseconds(800));
    ASSERT_TRUE(wired.Ready().ok());
    for (int i = 0; i < 3; ++i) {
      const auto shot = wired.TakeApart(milliseconds(20));
      if (absl::IsDataLoss(shot.frame.status())) continue;  // plain UDP on a busy machine
      ASSERT_TRUE(shot.frame.ok()) << shot.frame.status();
      if (event) {
        EXPECT_GE(shot.frame_came - shot.ended_came, milliseconds(300)) << "it was waited for";
      } else {
        EXPECT_GE(shot.ended_came - shot.triggered, milliseconds(820));
      }
      EXPECT_GE(shot.ended_came - shot.triggered, milliseconds(20)) << "not while it is exposed";
      EXPECT_GE(shot.ended_at - shot.triggered, milliseconds(20));
      EXPECT_LE(shot.ended_at, shot.ended_came);
    }
    if (event) {
      EXPECT_GE(wired.server().events_acknowledged(), 3);
    } else {
      EXPECT_EQ(wired.server().events_acknowledged(), 0);
    }
  }
}

// An event of the frame before, sent again, must not end this one's exposure.
TEST(SimGigeEvents, AnotherFramesEventCountsForNothing) {
  Wired wired;
  absl::Status opened = wired.Open("", /*chunk_data=*/false, 7000, /*exposure_events=*/true);
  ASSERT_TRUE(opened.ok()) << opened;
  wired.server().SetReadout(milliseconds(800));
  ASSERT_TRUE(wired.Ready().ok());
  wired.server().MisnumberEvents(-1);
  for (int i = 0; i < 3; ++i) {
    const auto shot = wired.TakeApart(milliseconds(20));
    if (absl::IsDataLoss(shot.frame.status())) continue;  // plain UDP on a busy machine
    ASSERT_TRUE(shot.frame.ok()) << shot.frame.status();
    EXPECT_GE(shot.ended_came - shot.triggered, milliseconds(820));
  }
  EXPECT_GE(wired.server().events_acknowledged(), 3);
}

TEST(SimGigeLines, MissingOnesNameThoseThereAre) {
  const std::pair<std::string, std::string> cases[] = {
      {"trigger_source = \"Line7\"\n",
       "camera: trigger_source needs TriggerSource = Line7; the camera has Line1, Software"},
      {"exposure_active_line = \"Line3\"\n",
       "camera: exposure_active_line needs LineSelector = Line3; the camera has Line1, Line2"}};
  for (const auto& [keys, message] : cases) {
    Wired wired;
    absl::Status refused = wired.Open(keys);
    EXPECT_EQ(ErrorReason(refused), "DEVICE_UNSUITABLE") << refused;
    EXPECT_NE(refused.message().find(message), std::string_view::npos) << refused;
  }
}

// What a frame says of itself is what is recorded.
TEST(SimGigeChunks, FramesSayHowTheyWereExposed) {
  for (int packet_size : {7000, 700}) {
    Wired wired;
    absl::Status opened = wired.Open("", /*chunk_data=*/true, packet_size);
    ASSERT_TRUE(opened.ok()) << opened;
    ASSERT_TRUE(wired.Ready(/*gain_db=*/3).ok());
    wired.server().Misreport(1.00005);
    absl::StatusOr<Frame> frame = wired.Take(milliseconds(16));
    for (int i = 0; i < 5 && ErrorReason(frame.status()) == "FRAME_INCOMPLETE"; ++i) {
      frame = wired.Take(milliseconds(16));
    }
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_NEAR(Seconds(frame->exposure), 0.0160008, 1e-9) << "0.8 us more than was set";
    EXPECT_EQ(frame->exposure_end - frame->exposure_start, frame->exposure);
    EXPECT_EQ(frame->gain_db, 3);
    EXPECT_EQ(frame->data.size(), static_cast<size_t>(kWidth) * kHeight);
  }
}

TEST(SimGigeChunks, AFrameThatWasNotExposedAsSetIsNotUsed) {
  Wired wired;
  absl::Status opened = wired.Open("", /*chunk_data=*/true);
  ASSERT_TRUE(opened.ok()) << opened;
  ASSERT_TRUE(wired.Ready().ok());
  wired.server().Misreport(1.5);
  absl::StatusOr<Frame> frame = wired.Take(milliseconds(16));
  for (int i = 0; i < 5 && ErrorReason(frame.status()) == "FRAME_INCOMPLETE"; ++i) {
    frame = wired.Take(milliseconds(16));
  }
  EXPECT_TRUE(absl::IsDataLoss(frame.status())) << frame.status();
  EXPECT_EQ(ErrorReason(frame.status()), "FRAME_EXPOSURE");
  EXPECT_EQ(MessageOf(frame.status()),
            "camera: the frame says ChunkExposureTime = 24000 us, set was 16000 us");
  wired.server().Misreport(1);
  frame = wired.Take(milliseconds(16));
  EXPECT_TRUE(frame.ok() || ErrorReason(frame.status()) == "FRAME_INCOMPLETE") << frame.status();
}

TEST(SimGigeChunks, CanBeDoneWithout) {
  Wired wired;
  absl::Status opened = wired.Open("chunk_data = false\n", /*chunk_data=*/true);
  ASSERT_TRUE(opened.ok()) << opened;
  ASSERT_TRUE(wired.Ready().ok());
  wired.server().Misreport(1.5);
  absl::StatusOr<Frame> frame = wired.Take(milliseconds(16));
  for (int i = 0; i < 5 && absl::IsDataLoss(frame.status()); ++i) {
    frame = wired.Take(milliseconds(16));
  }
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->exposure, milliseconds(16));
}

// Its heartbeat tells within a second. What waited for it is told so at once, and connects anew while the bad news is still under way.
TEST(SimGige, AClientThatWasDroppedConnectsAnew) {
  Wired wired;
  absl::Status opened = wired.Open("");
  ASSERT_TRUE(opened.ok()) << opened;
  ASSERT_TRUE(wired.Ready().ok());
  for (int i = 0; i < 3; ++i) {
    wired.server().DropControl(true);
    absl::Status lost;
    const TimePoint late = wired.In(seconds(30));
    while (!absl::IsUnavailable(lost) && wired.clock().Now() < late) {
      lost = wired.Take(milliseconds(10)).status();
    }
    EXPECT_EQ(ErrorReason(lost), "DEVICE_LOST") << lost;
    wired.server().DropControl(false);
    EXPECT_TRUE(wired.Disarm().ok());
    absl::Status ready = wired.Ready();
    ASSERT_TRUE(ready.ok()) << ready;
    absl::StatusOr<Frame> frame = wired.Take(milliseconds(10));
    EXPECT_TRUE(frame.ok() || absl::IsDataLoss(frame.status())) << frame.status();
  }
}

TEST(SimGige, SecondCameraOnTheInterfaceIsRefused) {
  Rig rig, second;
  ASSERT_TRUE(rig.Open(kNoNoise).ok());
  absl::Status refused = second.Open(kNoNoise);
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable) << refused;
  EXPECT_EQ(ErrorReason(refused), "PEER_NOT_STARTED");
  EXPECT_NE(refused.message().find("127.0.0.1"), std::string_view::npos);
}

TEST(SimGige, BadTablesAreRefused) {
  for (const char* bad : {"sensor_width = 63", "bits = 11", "sensor_height = 0", "hight = 48",
                          "packing = \"q\"", "bits = 16\npacking = \"p\""}) {
    DriverRegistry registry;
    RegisterGigePeer(registry, RegisterSimulatedDrivers(registry));
    absl::StatusOr<TomlDocument> document = TomlDocument::Parse(
        std::string("[camera]\naddress = \"127.0.0.1\"\n[camera.peer]\n") + bad + "\n", "rig.toml");
    ASSERT_TRUE(document.ok());
    registry.cameras.at("sim-gige").parse(document->root().Table("camera"));
    EXPECT_FALSE(document->Finish().ok()) << bad;
  }
}

}  // namespace
}  // namespace lightstage::sim
