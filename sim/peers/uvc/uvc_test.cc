// The simulated camera as the kernel's uvcvideo would meet it: what it says of itself, what is negotiated, and that each frame has the light
// of just its exposure.
#include <gtest/gtest.h>

#include <cerrno>
#include <cstring>

#include "base/status.h"
#include "sim/peers/uvc/camera_server.h"
#include "sim/peers/uvc/drivers.h"
#include "sim/peers/uvc/test_host.h"
#include "sim/rig/test_rig.h"

namespace lightstage::sim {
namespace {

using std::chrono::milliseconds;

constexpr int kWidth = 64, kHeight = 48;
constexpr uint32_t kRequestBytes = 16384;

// Requests of the Video Class (UVC 1.1, table A-8) to a unit's control.
constexpr uint8_t kSetCur = 1, kGetCur = 0x81, kGetMin = 0x82, kGetMax = 0x83, kGetRes = 0x84,
                  kGetLen = 0x85, kGetInfo = 0x86, kGetDef = 0x87;
UsbSetup Ask(uint8_t request, int unit, int selector, int length) {
  return {static_cast<uint8_t>(request == kSetCur ? 0x21 : 0xa1), request,
          static_cast<uint16_t>(selector << 8), static_cast<uint16_t>(unit << 8),
          static_cast<uint16_t>(length)};
}
UsbSetup AskStream(uint8_t request, int selector) {
  UsbSetup setup = Ask(request, 0, selector, 34);
  setup.index = 1;
  return setup;
}

Bytes U32(uint32_t value) {
  return {static_cast<uint8_t>(value), static_cast<uint8_t>(value >> 8),
          static_cast<uint8_t>(value >> 16), static_cast<uint8_t>(value >> 24)};
}

class UvcTest : public testing::Test {
 protected:
  void SetUp() override {
    WorldOptions options;
    options.samples = 2;
    options.sensor.photon_noise = false;
    options.sensor.read_noise_e = 0;
    options.sensor.line_time = std::chrono::microseconds(20);
    auto world = World::Create(options, Rig(), clock_);
    ASSERT_TRUE(world.ok()) << world.status();
    world_ = *world;
    Restart({"Test camera", kWidth, kHeight, 12, milliseconds(40), 0.5});
  }
  // Another camera, plugged in anew.
  void Restart(const UvcCameraOptions& options) {
    server_.reset();
    requested_.clear();
    host_.emplace();
    server_.emplace(options, world_, host_->device_end());
  }

  Bytes Get(const UsbSetup& setup) {
    const auto answer = host_->Control(setup);
    EXPECT_TRUE(answer && answer->status == 0);
    return answer ? answer->data : Bytes();
  }
  int Set(const UsbSetup& setup, const Bytes& data) {
    const auto answer = host_->Control(setup, data);
    return answer ? answer->status : -ENODEV;
  }
  void SetExposure(uint32_t units) {
    EXPECT_EQ(Set(Ask(kSetCur, 1, 2, 1), {1}), 0);
    EXPECT_EQ(Set(Ask(kSetCur, 1, 4, 4), U32(units)), 0);
  }
  Bytes Probed(uint8_t format) {
    Bytes block(34);
    block[2] = format;
    block[3] = 1;
    EXPECT_EQ(Set(AskStream(kSetCur, 1), block), 0);
    return Get(AskStream(kGetCur, 1));
  }
  void StartStream(uint8_t format = 1, int requests = 5) {
    EXPECT_EQ(Set(AskStream(kSetCur, 2), Probed(format)), 0);
    for (int i = 0; i < requests; ++i) requested_.push_back(host_->Submit(1, true, kRequestBytes));
  }
  void StopStream() {
    for (uint32_t request : requested_) host_->Unlink(request);
    EXPECT_EQ(Set({2, 1, 0, 0x81, 0}, {}), 0);  // CLEAR_FEATURE, ENDPOINT_HALT
    requested_.clear();
    host_->TakeOthers();
  }

  struct Payload {
    uint8_t info = 0;
    Bytes data;
  };
  std::optional<Payload> NextPayload(int patience_ms = 20000) {
    const auto answer = host_->Next(patience_ms);
    if (!answer) return std::nullopt;
    EXPECT_EQ(answer->command, 3u);
    EXPECT_EQ(answer->status, 0);
    EXPECT_GE(answer->data.size(), 2u);
    if (answer->data.size() < 2) return std::nullopt;
    EXPECT_EQ(answer->data[0], 2);
    std::erase(requested_, answer->seqnum);
    requested_.push_back(host_->Submit(1, true, kRequestBytes));
    return Payload{answer->data[1], Bytes(answer->data.begin() + 2, answer->data.end())};
  }
  // The payloads of one frame: the first has nothing yet, the rest fits into one here.
  std::optional<Payload> NextFrame() {
    std::optional<Payload> first = NextPayload();
    began_ = clock_.Now();
    EXPECT_TRUE(!first || (first->data.empty() && (first->info & 0x82) == 0x80)) << "EOH";
    std::optional<Payload> payload = NextPayload();
    EXPECT_TRUE(!payload || (payload->info & 0x82) == 0x82) << "EOH, EOF";
    EXPECT_TRUE(!payload || !first || ((payload->info ^ first->info) & 1) == 0) << "FID";
    return payload;
  }
  void Light(float level) { world_->RampLamps(clock_.Now(), {}, {}, {level, 0, 0}); }
  Bytes Seen(TimePoint start, Duration exposure, PixelFormat format = PixelFormat::kMono16,
             double gain_db = 0, FilmSize size = {kWidth, kHeight}) {
    const auto frame = world_->Expose(start, start + exposure, format, size, 12, gain_db);
    EXPECT_TRUE(frame.ok()) << frame.status();
    Bytes bytes(frame->data.size());
    std::memcpy(bytes.data(), frame->data.data(), bytes.size());
    return bytes;
  }
  // Codes that may differ by one: what is summed up over other times is rounded otherwise.
  static bool Same(const Bytes& a, const Bytes& b, PixelFormat format = PixelFormat::kMono16) {
    if (a.size() != b.size()) return false;
    const size_t bytes = format == PixelFormat::kMono16 ? 2 : 1;
    const auto code = [&](const Bytes& of, size_t at) {
      return of[at] + (bytes == 2 ? of[at + 1] << 8 : 0);
    };
    for (size_t i = 0; i < a.size(); i += bytes) {
      if (std::abs(code(a, i) - code(b, i)) > 1) return false;
    }
    return true;
  }

  RealClock clock_;
  std::shared_ptr<World> world_;
  std::optional<TestHost> host_;
  std::vector<uint32_t> requested_;
  TimePoint began_{};  // when the first payload of the last frame was there: the host's stamp
  std::optional<UvcCameraServer> server_;
};

// ---- What it says of itself

TEST_F(UvcTest, Enumeration) {
  EXPECT_EQ(Get({0x80, 6, 0x0100, 0, 64}), (Bytes{18, 1, 0x00, 0x02, 0xef, 2, 1, 64, 0x6b, 0x1d,
                                                  0x02, 0x01, 0x00, 0x01, 1, 2, 0, 1}));
  EXPECT_EQ(Get({0x80, 6, 0x0200, 0, 9}).size(), 9u);
  const Bytes all = Get({0x80, 6, 0x0200, 0, 4096});
  // By the tables of the Video Class 1.1: 2-1 and 3-2 to 3-6, and those of the uncompressed payload.
  const Bytes expected = {
      9,    2,    235,  0,    2,    1,    0,    0x80, 250,                        // configuration
      8,    11,   0,    2,    0x0e, 3,    0,    0,                                // both interfaces
      9,    4,    0,    0,    0,    0x0e, 1,    0,    0,                          // video control
      13,   0x24, 1,    0x10, 0x01, 52,   0,    0x00, 0x6c, 0xdc, 0x02, 1,    1,  // 1.1, 48 MHz
      18,   0x24, 2,    1,    0x01, 0x02, 0,    0,    0,    0,    0,    0,    0,    0,
      3,    0x0a, 0,    0,                                                  // camera
      12,   0x24, 5,    2,    1,    0,    0,    2,    0x00, 0x02, 0,    0,  // gain
      9,    0x24, 3,    3,    0x01, 0x01, 0,    2,    0,                    // stream
      9,    4,    1,    0,    1,    0x0e, 2,    0,    0,                    // video streaming
      15,   0x24, 1,    2,    141,  0,    0x81, 0,    3,    0,    0,    0,    1,    0,
      0,  // two formats
      27,   0x24, 4,    1,    1,    'Y',  '1',  '6',  ' ',  0,    0,    0x10, 0,    0x80,
      0,    0,    0xaa, 0,    0x38, 0x9b, 0x71, 16,   1,    0,    0,    0,    0,  //
      30,   0x24, 5,    1,    0,    64,   0,    48,   0,    0x00, 0xc0, 0x12, 0x00, 0x00,
      0xc0, 0x12, 0x00, 0x00, 0x18, 0,    0,    0x80, 0x1a, 0x06, 0,    1,    0x80, 0x1a,
      0x06, 0,                          // 6144 bytes, 40 ms
      6,    0x24, 13,   1,    1,    4,  //
      27,   0x24, 4,    2,    1,    'Y',  '8',  ' ',  ' ',  0,    0,    0x10, 0,    0x80,
      0,    0,    0xaa, 0,    0x38, 0x9b, 0x71, 8,    1,    0,    0,    0,    0,  //
      30,   0x24, 5,    1,    0,    64,   0,    48,   0,    0x00, 0x60, 0x09, 0x00, 0x00,
      0x60, 0x09, 0x00, 0x00, 0x0c, 0,    0,    0x80, 0x1a, 0x06, 0,    1,    0x80, 0x1a,
      0x06, 0,                                 //
      6,    0x24, 13,   1,    1,    4,         //
      7,    5,    0x81, 2,    0x00, 0x02, 0};  // bulk, 512
  EXPECT_EQ(all, expected);
  EXPECT_EQ(all.size(), all[2] + 256u * all[3]);
  EXPECT_EQ(Get({0x80, 6, 0x0300, 0, 255}), (Bytes{4, 3, 9, 4}));
  const Bytes product = Get({0x80, 6, 0x0302, 0x0409, 255});
  ASSERT_EQ(product.size(), 2 + 2 * std::strlen("Test camera"));
  EXPECT_EQ(product[2], 'T');
  EXPECT_EQ(Set({0x00, 9, 1, 0, 0}, {}), 0);
  EXPECT_EQ(Get({0x80, 8, 0, 0, 1}), Bytes{1});
  // It has no other speed, no third string and no other setting.
  EXPECT_EQ(host_->Control({0x80, 6, 0x0600, 0, 10})->status, -EPIPE);
  EXPECT_EQ(host_->Control({0x80, 6, 0x0309, 0x0409, 255})->status, -EPIPE);
  EXPECT_EQ(Set({0x01, 11, 1, 1, 0}, {}), -EPIPE);
}

TEST_F(UvcTest, ProbeAndCommit) {
  const Bytes block = Probed(2);
  EXPECT_EQ(block,
            (Bytes{1, 0,    2,    1, 0x80, 0x1a, 0x06, 0, 0, 0,    0,    0,    0,    0, 0, 0, 0,
                   0, 0x00, 0x0c, 0, 0,    0x00, 0x40, 0, 0, 0x00, 0x6c, 0xdc, 0x02, 3, 0, 0, 0}));
  EXPECT_EQ(Get(AskStream(kGetDef, 1))[2], 1);
  EXPECT_EQ(Get(AskStream(kGetLen, 1)), (Bytes{34, 0}));
  EXPECT_EQ(Get(AskStream(kGetInfo, 1)), Bytes{3});
  // What it does not have is proposed otherwise, and not committed.
  EXPECT_EQ(Probed(9)[2], 1);
  Bytes wrong = block;
  wrong[2] = 9;
  EXPECT_EQ(Set(AskStream(kSetCur, 2), wrong), -EPIPE);
  EXPECT_EQ(Get(Ask(kGetCur, 0, 2, 1)), Bytes{4}) << "out of range";
  EXPECT_EQ(Set(AskStream(kSetCur, 2), block), 0);
  EXPECT_EQ(Get(AskStream(kGetCur, 2)), block);
}

TEST_F(UvcTest, ControlsHaveRangesAndSayWhyTheyRefuse) {
  EXPECT_EQ(Get(Ask(kGetMin, 1, 4, 4)), U32(1));
  EXPECT_EQ(Get(Ask(kGetMax, 1, 4, 4)), U32(400));
  EXPECT_EQ(Get(Ask(kGetRes, 1, 2, 1)), Bytes{9}) << "manual, aperture priority";
  EXPECT_EQ(Get(Ask(kGetMax, 2, 4, 2)), (Bytes{48, 0})) << "24 dB";
  EXPECT_EQ(Set(Ask(kSetCur, 1, 4, 4), U32(10)), -EPIPE) << "it is automatic";
  EXPECT_EQ(Get(Ask(kGetCur, 0, 2, 1)), Bytes{2}) << "wrong state";
  SetExposure(10);
  EXPECT_EQ(Get(Ask(kGetCur, 1, 4, 4)), U32(10));
  EXPECT_EQ(Set(Ask(kSetCur, 1, 4, 4), U32(401)), -EPIPE);
  EXPECT_EQ(Get(Ask(kGetCur, 0, 2, 1)), Bytes{4}) << "out of range";
  EXPECT_EQ(Set(Ask(kSetCur, 7, 4, 4), U32(1)), -EPIPE);
  EXPECT_EQ(Get(Ask(kGetCur, 0, 2, 1)), Bytes{5}) << "invalid unit";
  EXPECT_EQ(Set(Ask(kSetCur, 2, 9, 2), {0, 0}), -EPIPE);
  EXPECT_EQ(Get(Ask(kGetCur, 0, 2, 1)), Bytes{6}) << "invalid control";
  server_->Fail(UvcFault::kStalls);
  EXPECT_EQ(Set(Ask(kSetCur, 1, 4, 4), U32(20)), -EPIPE);
  EXPECT_EQ(Get(Ask(kGetCur, 0, 2, 1)), Bytes{1}) << "not ready";
  server_->Fail(UvcFault::kNone);
  EXPECT_EQ(Get(Ask(kGetCur, 1, 4, 4)), U32(10)) << "it was not taken";
}

// ---- What it sees

TEST_F(UvcTest, FramesHaveTheLightOfTheirExposure) {
  Light(1);
  SetExposure(50);
  const Bytes lit = Seen(clock_.Now(), milliseconds(5));
  ASSERT_FALSE(Same(lit, Seen(clock_.Now(), milliseconds(10))));
  StartStream();
  uint8_t last = 0;
  for (int i = 0; i < 4; ++i) {
    const auto frame = NextFrame();
    ASSERT_TRUE(frame);
    EXPECT_TRUE(Same(frame->data, lit)) << i;
    EXPECT_TRUE(i == 0 || (frame->info ^ last) == 1) << "FID toggles from frame to frame";
    last = frame->info;
  }
  StopStream();
  EXPECT_EQ(Set(Ask(kSetCur, 2, 4, 2), {12, 0}), 0);
  StartStream(2);
  const auto grey = NextFrame();
  ASSERT_TRUE(grey);
  EXPECT_TRUE(Same(grey->data, Seen(clock_.Now(), milliseconds(5), PixelFormat::kMono8, 6),
                   PixelFormat::kMono8));
}

// A lamp that goes on in the middle of frames: each is dark, full, or has a share that an exposure of its length had; and the first one that began
// afterwards is full.
TEST_F(UvcTest, NoFrameHasLightFromBeforeOrAfterItsExposure) {
  SetExposure(200);
  StartStream();
  ASSERT_TRUE(NextFrame());
  for (int i = 0; i < 6; ++i) {
    std::this_thread::sleep_for(milliseconds(7 * i));
    Light(1);
    ASSERT_TRUE(NextFrame());  // may have begun before
    const auto lit = NextFrame();
    ASSERT_TRUE(lit);
    EXPECT_TRUE(Same(lit->data, Seen(clock_.Now(), milliseconds(20))));
    Light(0);
    ASSERT_TRUE(NextFrame());
    const auto dark = NextFrame();
    ASSERT_TRUE(dark);
    EXPECT_EQ(dark->data, Bytes(dark->data.size()));
  }
}

// The frame that is being exposed keeps what it began with, and the next one has what was set.
TEST_F(UvcTest, AnExposureCountsForFramesThatBeginAfterItWasSet) {
  Restart({"Slow", kWidth, kHeight, 12, milliseconds(1200), 1});
  Light(0.03f);
  const Bytes longer = Seen(clock_.Now(), milliseconds(900)),
              shorter = Seen(clock_.Now(), milliseconds(300));
  ASSERT_FALSE(Same(longer, shorter));
  SetExposure(9000);
  StartStream(1, 1);
  std::this_thread::sleep_for(milliseconds(450));  // half of the exposure
  SetExposure(3000);
  EXPECT_TRUE(host_->TakeOthers().empty());
  EXPECT_TRUE(Same(NextFrame()->data, longer));
  EXPECT_TRUE(Same(NextFrame()->data, shorter));
}

// A frame without light began after the light was off, and is there no sooner than its exposure and the latency after that.
TEST_F(UvcTest, FramesAreHeldBackForTheLatency) {
  UvcCameraOptions options{"Late", kWidth, kHeight, 12, milliseconds(40), 1};
  options.latency = milliseconds(150);
  Restart(options);
  SetExposure(50);
  Light(1);
  StartStream();
  ASSERT_TRUE(NextFrame());
  for (int i = 0; i < 3; ++i) {
    const TimePoint off = clock_.Now();
    Light(0);
    std::optional<Payload> frame;
    do {
      frame = NextFrame();
      ASSERT_TRUE(frame);
    } while (frame->data != Bytes(frame->data.size()));
    EXPECT_GE(began_ - off, milliseconds(155));
    Light(1);
    ASSERT_TRUE(NextFrame());
    ASSERT_TRUE(NextFrame());
  }
}

TEST_F(UvcTest, AFrameThatIsThereTooLateIsDamaged) {
  UvcCameraOptions options{"Strict", kWidth, kHeight, 12, milliseconds(40), 1};
  options.latency_limit = std::chrono::seconds(5);
  Restart(options);
  SetExposure(50);
  StartStream();
  auto frame = NextFrame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->info & 0x40, 0);
  options.latency = milliseconds(50);
  options.latency_limit = milliseconds(49);
  Restart(options);
  SetExposure(50);
  StartStream();
  frame = NextFrame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->info & 0x40, 0x40);
}

TEST_F(UvcTest, WithoutAStreamNothingIsExposed) {
  std::this_thread::sleep_for(milliseconds(100));
  EXPECT_EQ(server_->frames(), 0);
  StartStream();
  ASSERT_TRUE(NextFrame());
  StopStream();
  const int frames = server_->frames();
  std::this_thread::sleep_for(milliseconds(150));
  EXPECT_LE(server_->frames(), frames + 1);
  StartStream();
  ASSERT_TRUE(NextFrame());
}

// ---- Faults

TEST_F(UvcTest, DamagedFramesAreFlaggedAndShortOnesShort) {
  Light(1);
  SetExposure(50);
  StartStream();
  ASSERT_TRUE(NextFrame());
  server_->Fail(UvcFault::kDamaged);
  ASSERT_TRUE(NextFrame());
  const auto damaged = NextFrame();
  ASSERT_TRUE(damaged);
  EXPECT_EQ(damaged->info & 0x40, 0x40);
  EXPECT_FALSE(Same(damaged->data, Seen(clock_.Now(), milliseconds(5))));
  server_->Fail(UvcFault::kShort);
  ASSERT_TRUE(NextFrame());
  const auto brief = NextFrame();
  ASSERT_TRUE(brief);
  EXPECT_EQ(brief->data.size(), kWidth * kHeight * 2u / 2);
  server_->Fail(UvcFault::kSilent);
  NextPayload(100);
  EXPECT_FALSE(NextPayload(300));
  server_->Fail(UvcFault::kNone);
  ASSERT_TRUE(NextFrame());
}

TEST_F(UvcTest, DisturbedTransfersFailAndTheNextStreamIsWhole) {
  StartStream();
  ASSERT_TRUE(NextFrame());
  server_->BreakTransfers();
  int failed = 0;
  while (const auto answer = host_->Next(500)) {
    if (answer->status == 0) continue;
    EXPECT_EQ(answer->status, -EPROTO);
    std::erase(requested_, answer->seqnum);
    ++failed;
  }
  EXPECT_GE(failed, 4);
  StopStream();
  StartStream();
  for (int i = 0; i < 3; ++i) {
    const auto frame = NextFrame();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->data.size(), kWidth * kHeight * 2u);
  }
}

// A frame of more than one payload, into requests that are shorter.
TEST_F(UvcTest, LargeFramesComeInPayloads) {
  constexpr int kLargeWidth = 160, kLargeHeight = 120;
  constexpr uint32_t kBriefRequest = 4096;
  Restart({"Large", kLargeWidth, kLargeHeight, 12, milliseconds(40), 1});
  Light(1);
  SetExposure(50);
  StartStream(1, 0);
  for (int i = 0; i < 5; ++i) host_->Submit(1, true, kBriefRequest);
  Bytes picture;
  std::vector<size_t> payloads;
  for (uint8_t info = 0; (info & 2) == 0;) {
    Bytes payload;
    for (bool ended = false; !ended;) {
      const auto part = host_->Next();
      ASSERT_TRUE(part);
      host_->Submit(1, true, kBriefRequest);
      payload.insert(payload.end(), part->data.begin(), part->data.end());
      ended = part->data.size() < kBriefRequest || payload.size() == kUvcPayloadBytes;
    }
    ASSERT_GE(payload.size(), 2u);
    info = payload[1];
    payloads.push_back(payload.size());
    picture.insert(picture.end(), payload.begin() + 2, payload.end());
  }
  EXPECT_EQ(payloads,
            (std::vector<size_t>{2, kUvcPayloadBytes, kUvcPayloadBytes,
                                 kLargeWidth * kLargeHeight * 2 + 3 * 2 - 2 * kUvcPayloadBytes}));
  EXPECT_TRUE(Same(picture, Seen(clock_.Now(), milliseconds(5), PixelFormat::kMono16, 0,
                                 {kLargeWidth, kLargeHeight})));
}

// ---- The table

absl::Status Parsed(const std::string& keys) {
  DriverRegistry registry;
  RegisterUvcPeer(registry, RegisterSimulatedDrivers(registry));
  auto document = TomlDocument::Parse(keys, "rig.toml");
  if (!document.ok()) return document.status();
  registry.cameras["sim-v4l2"].parse(document->root());
  return document->Finish();
}

TEST(UvcTable, IsThatOfTheDriver) {
  EXPECT_EQ(Parsed("card = \"Test camera\"\nframes_per_s = 25\nsignificant_bits = 12\n"
                   "[peer]\nsensor_width = 64\nsensor_height = 48\nfault_interval_s = 1\n"),
            absl::OkStatus());
  const auto refused = [](const std::string& keys, const std::string& part) {
    const absl::Status status = Parsed(keys);
    EXPECT_NE(MessageOf(status).find(part), std::string::npos) << status;
  };
  refused("device = \"/dev/video0\"\n", "card");
  refused("card = \"A name that the kernel would cut off\"\n", "at most 31");
  EXPECT_EQ(Parsed("card = \"x\"\nlatency_ms = 60\n[peer]\nlatency_ms = 50\n"), absl::OkStatus());
  refused("card = \"x\"\nlatency_ms = 50\n[peer]\nlatency_ms = 50\n", "greater than the 50 ms");
  refused("card = \"x\"\nstamps_at_exposure_start = true\n", "stamps_at_exposure_start");
  refused("card = \"x\"\n[peer]\nbits = 12\n", "bits");
}

}  // namespace
}  // namespace lightstage::sim
