#include "sim/peers/gige/camera_server.h"

#include <arpa/inet.h>
#include <arv.h>
#include <netinet/in.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <bit>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "absl/strings/str_format.h"
#include "base/env.h"
#include "drivers/aravis/capabilities.h"
#include "sim/peers/gige/genicam.h"
#include "sim/peers/gige/pack.h"

namespace lightstage::sim {
namespace {

// How often the fake camera looks for a trigger: the start of an exposure may be late by one period, and it polls busily for the
// last millisecond of each.
constexpr double kTriggerHz = 200;

// GigE Vision's bootstrap register: ms without a sign of life after which the camera drops its client. The fake camera is deaf
// while it exposes.
constexpr guint32 kHeartbeatTimeoutRegister = 0x0938;
constexpr guint32 kHeartbeatTimeoutMs = 30000;

// More of them: the stream's destination and packet size.
constexpr guint32 kStreamPortRegister = 0x0d00, kPacketSizeRegister = 0x0d04,
                  kStreamAddressRegister = 0x0d18;
// And the message channel's: how many there are, and where the client wants its events.
constexpr guint32 kMessageChannelsRegister = 0x0900, kMessagePortRegister = 0x0b00,
                  kMessageAddressRegister = 0x0b10;
constexpr size_t kPacketOverhead = 20 + 8 + 8;  // headers of IP, UDP and GVSP

constexpr int kControlPort = 3956;

std::vector<std::byte> BigEndian(double value) {
  const uint64_t bits = std::bit_cast<uint64_t>(value);
  std::vector<std::byte> bytes;
  for (int shift = 56; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::byte>(bits >> shift));
  return bytes;
}

// The fake camera shares its port with any other one, so that each gets some of the packets: look before it starts.
absl::Status CheckPortIsFree(const std::string& address) {
  sockaddr_in at = {};
  at.sin_family = AF_INET;
  at.sin_port = htons(kControlPort);
  if (inet_pton(AF_INET, address.c_str(), &at.sin_addr) != 1) {
    return Error(absl::StatusCode::kInvalidArgument, "PEER_NOT_STARTED",
                 absl::StrCat("'", address, "' is no IPv4 address to serve a camera on"),
                 {{"address", address}});
  }
  int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  bool free = fd >= 0 && bind(fd, reinterpret_cast<sockaddr*>(&at), sizeof at) == 0;
  int error = errno;
  if (fd >= 0) close(fd);
  if (free) return absl::OkStatus();
  return Error(absl::StatusCode::kUnavailable, "PEER_NOT_STARTED",
               absl::StrFormat("can not serve a GigE Vision camera on %s, UDP port %d: %s", address,
                               kControlPort, std::strerror(error)),
               {{"address", address}, {"port", absl::StrCat(kControlPort)}});
}

// libaravis reads the description from a file.
absl::StatusOr<std::string> WriteDescription(const GigeCameraOptions& options) {
  ArvFakeCamera* plain = arv_fake_camera_new(options.serial.c_str());
  size_t size = 0;
  const char* text = arv_fake_camera_get_genicam_xml(plain, &size);
  absl::StatusOr<std::string> xml = AdaptGenicam(std::string(text, size), options);
  g_object_unref(plain);
  RETURN_IF_ERROR(xml.status());
  std::string path = std::filesystem::temp_directory_path() / "lightstage-gige-XXXXXX";
  int fd = mkstemp(path.data());
  if (fd < 0) return ErrnoError(errno, "creating", path);
  close(fd);
  RETURN_IF_ERROR(PosixEnv().WriteFile(path, *xml));
  return path;
}

// The fake camera looks whether it shall still stream only when it is asked something: asks it for a register and waits for the answer.
void AwaitCommand(const std::string& address) {
  constexpr uint8_t kReadRegister0[] = {0x42, 0x01, 0x00, 0x80, 0, 4, 0, 1, 0, 0, 0, 0};
  constexpr int kPatienceMs = 1000;
  sockaddr_in at = {};
  at.sin_family = AF_INET;
  at.sin_port = htons(kControlPort);
  inet_pton(AF_INET, address.c_str(), &at.sin_addr);
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return;
  pollfd answer = {fd, POLLIN, 0};
  if (sendto(fd, kReadRegister0, sizeof kReadRegister0, 0, reinterpret_cast<sockaddr*>(&at),
             sizeof at) > 0) {
    poll(&answer, 1, kPatienceMs);
  }
  close(fd);
}

// A region's rows, which end with whole bytes, as they are sent.
std::vector<std::byte> Packed(std::vector<std::byte> region, const GenicamFormat& format) {
  if (format.packing == GenicamPacking::kNone) return region;
  std::vector<uint16_t> samples(region.size() / 2);
  std::memcpy(samples.data(), region.data(), region.size());
  return format.packing == GenicamPacking::kLsbFirst
             ? PackLowestFirst(samples, format.significant_bits)
             : PackGigE(samples, format.significant_bits);
}

}  // namespace

GigeCameraServer::GigeCameraServer(const GigeCameraOptions& options, std::shared_ptr<World> world)
    : options_(options), world_(std::move(world)) {}

absl::StatusOr<std::unique_ptr<GigeCameraServer>> GigeCameraServer::Start(
    const GigeCameraOptions& options, std::shared_ptr<World> world) {
  RETURN_IF_ERROR(CheckPortIsFree(options.address));
  ASSIGN_OR_RETURN(std::string description, WriteDescription(options));
  std::unique_ptr<GigeCameraServer> server(new GigeCameraServer(options, std::move(world)));
  server->camera_ = arv_gv_fake_camera_new_full(options.address.c_str(), options.serial.c_str(),
                                                description.c_str());
  std::filesystem::remove(description);
  if (!arv_gv_fake_camera_is_running(server->camera_)) {
    return Error(absl::StatusCode::kUnavailable, "PEER_NOT_STARTED",
                 absl::StrCat("can not serve a GigE Vision camera on ", options.address,
                              ": no network interface has this address"),
                 {{"address", options.address}});
  }
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(server->camera_);
  const struct {
    guint32 address, value;
  } registers[] = {{ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, static_cast<guint32>(options.width)},
                   {ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, static_cast<guint32>(options.height)},
                   {ARV_FAKE_CAMERA_REGISTER_WIDTH, static_cast<guint32>(options.width)},
                   {ARV_FAKE_CAMERA_REGISTER_HEIGHT, static_cast<guint32>(options.height)},
                   {ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE, 1},
                   {kTriggerSourceRegister, 1},
                   {kHeartbeatTimeoutRegister, kHeartbeatTimeoutMs},
                   {kMessageChannelsRegister, options.exposure_events ? 1u : 0u}};
  for (const auto& r : registers) arv_fake_camera_write_register(fake, r.address, r.value);
  if (options.chunk_data) RETURN_IF_ERROR(server->StartRelay());
  if (options.exposure_events) {
    server->events_socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (server->events_socket_ < 0) return ErrnoError(errno, "opening a socket for", "events");
  }
  arv_fake_camera_set_trigger_frequency(fake, kTriggerHz);
  auto fill =
      +[](ArvBuffer* buffer, void* self, guint32 exposure_us, guint32 gain, ArvPixelFormat code) {
        static_cast<GigeCameraServer*>(self)->Expose(buffer, std::chrono::microseconds(exposure_us),
                                                     gain, code);
      };
  arv_fake_camera_set_fill_pattern(fake, fill, server.get());
  return server;
}

absl::Status GigeCameraServer::StartRelay() {
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(camera_);
  in_addr own = {};
  inet_pton(AF_INET, options_.address.c_str(), &own);
  arv_fake_camera_write_register(fake, kStreamAddressRegister, ntohl(own.s_addr));
  ASSIGN_OR_RETURN(relay_, ChunkRelay::Start(
                               options_.address, [this] { return RelayedFrame(); },
                               [this](uint16_t port) { return TendStream(port); }));
  return absl::OkStatus();
}

ChunkRelay::Frame GigeCameraServer::RelayedFrame() const {
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(camera_);
  const auto value = [&](uint32_t address) {
    guint32 read = 0;
    arv_fake_camera_read_register(fake, address, &read);
    return read;
  };
  ChunkRelay::Frame frame;
  frame.client.sin_family = AF_INET;
  frame.client.sin_port = htons(static_cast<uint16_t>(value(kClientPortRegister)));
  frame.client.sin_addr.s_addr = htonl(value(kClientAddressRegister));
  frame.block = (value(kPacketSizeRegister) & 0xffff) - kPacketOverhead;
  if (value(kChunkModeRegister) == 0) return frame;
  if (value(kChunkEnableRegister) != 0) {
    frame.chunks.push_back({kExposureChunk, BigEndian(exposure_us_ * misreport_)});
  }
  if (value(kChunkEnableRegister + 0x10) != 0) {
    frame.chunks.push_back({kGainChunk, BigEndian(gain_db_)});
  }
  return frame;
}

// A client that ends its stream clears the port, so that it must be set anew before each acquisition. Hence begin and end of one go
// through registers of their own. True if a stream has ended.
bool GigeCameraServer::TendStream(uint16_t port) {
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(camera_);
  guint32 start = 0, stop = 0;  // read in this order: what begins anew was ended before
  arv_fake_camera_read_register(fake, kStartRegister, &start);
  arv_fake_camera_read_register(fake, kStopRegister, &stop);
  if (stop != 0) {
    arv_fake_camera_write_register(fake, kStopRegister, 0);
    arv_fake_camera_write_register(fake, ARV_FAKE_CAMERA_REGISTER_ACQUISITION, 0);
    // It looks after it has answered: the second answer comes after the look.
    for (int i = 0; i < 2; ++i) AwaitCommand(options_.address);
  }
  if (start != 0) {
    arv_fake_camera_write_register(fake, kStartRegister, 0);
    arv_fake_camera_write_register(fake, kStreamPortRegister, port);
    arv_fake_camera_write_register(fake, ARV_FAKE_CAMERA_REGISTER_ACQUISITION, 1);
  }
  return stop != 0;
}

void GigeCameraServer::LosePackets(double ratio) {
  g_object_set(camera_, "gvsp-lost-ratio", ratio, nullptr);
}

void GigeCameraServer::DropControl(bool on) {
  arv_fake_camera_write_register(arv_gv_fake_camera_get_fake_camera(camera_),
                                 kHeartbeatTimeoutRegister, on ? 0 : kHeartbeatTimeoutMs);
}

void GigeCameraServer::PulseLine() {
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(camera_);
  guint32 source = 0;
  arv_fake_camera_read_register(fake, kTriggerSourceRegister, &source);
  if (source == 0)
    arv_fake_camera_write_register(fake, ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE, 1);
}

bool GigeCameraServer::ShowsExposure() const {
  constexpr uint32_t kLine2 = 0x10;
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(camera_);
  guint32 mode = 0, source = 0;
  arv_fake_camera_read_register(fake, kLineModeRegister + kLine2, &mode);
  arv_fake_camera_read_register(fake, kLineSourceRegister + kLine2, &source);
  return mode == 1 && source == 1;
}

GigeCameraServer::~GigeCameraServer() {
  // The exposure in progress gives no picture, and what is sent in its place is not to arrive.
  if (camera_ != nullptr) LosePackets(1);
  stopping_ = true;
  world_->clock().Notify();
  relay_.reset();                        // it looks into the camera
  if (camera_) g_object_unref(camera_);  // joins its thread
  if (events_socket_ >= 0) close(events_socket_);
}

// EVENT_CMD, and once more if the client does not acknowledge it soon, as GigE Vision wants it.
void GigeCameraServer::TellExposureEnd(uint64_t frame_id) {
  constexpr int kAcknowledgeMs = 100;
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(camera_);
  guint32 on = 0, port = 0, address = 0;
  arv_fake_camera_read_register(fake, kEventNotificationRegister, &on);
  arv_fake_camera_read_register(fake, kMessagePortRegister, &port);
  arv_fake_camera_read_register(fake, kMessageAddressRegister, &address);
  if (events_socket_ < 0 || on == 0 || (port & 0xffff) == 0) return;
  sockaddr_in client = {};
  client.sin_family = AF_INET;
  client.sin_port = htons(static_cast<uint16_t>(port));
  client.sin_addr.s_addr = htonl(address);
  if (++events_told_ == 0) ++events_told_;
  const auto high = static_cast<uint8_t>(events_told_ >> 8),
             low = static_cast<uint8_t>(events_told_);
  const uint8_t event[24] = {0x42,
                             0x01,
                             0x00,
                             0xc0,
                             0,
                             16,
                             high,
                             low,
                             0,
                             0,
                             kExposureEndEvent >> 8,
                             kExposureEndEvent & 0xff,
                             0,
                             0,
                             static_cast<uint8_t>(frame_id >> 8),
                             static_cast<uint8_t>(frame_id)};
  for (int i = 0; i < 2; ++i) {
    sendto(events_socket_, event, sizeof event, 0, reinterpret_cast<sockaddr*>(&client),
           sizeof client);
    pollfd answer = {events_socket_, POLLIN, 0};
    uint8_t packet[64];
    if (poll(&answer, 1, kAcknowledgeMs) <= 0) continue;
    if (recv(events_socket_, packet, sizeof packet, 0) == 8 && packet[3] == 0xc1 &&
        packet[6] == high && packet[7] == low) {
      ++events_acknowledged_;
      return;
    }
  }
}

void GigeCameraServer::Expose(ArvBuffer* buffer, Duration exposure, double gain_db, uint32_t code) {
  Clock& clock = world_->clock();
  TimePoint start = clock.Now();
  clock.WaitUntil(start + exposure, [this] { return stopping_.load(); });
  if (stopping_) return;
  TellExposureEnd(arv_buffer_get_frame_id(buffer) + static_cast<uint64_t>(event_offset_.load()));
  const TimePoint read_out = clock.Now() + readout_.load();
  clock.WaitUntil(read_out, [this] { return stopping_.load(); });
  if (stopping_) return;
  exposure_us_ = Seconds(exposure) * 1e6;
  gain_db_ = gain_db;

  int x = 0, y = 0, width = 0, height = 0;
  arv_buffer_get_image_region(buffer, &x, &y, &width, &height);
  ArvFakeCamera* fake = arv_gv_fake_camera_get_fake_camera(camera_);
  guint32 left = 0, top = 0;
  arv_fake_camera_read_register(fake, ARV_FAKE_CAMERA_REGISTER_X_OFFSET, &left);
  arv_fake_camera_read_register(fake, ARV_FAKE_CAMERA_REGISTER_Y_OFFSET, &top);

  const GenicamFormat format = UsableFormats({code}).at(0);
  absl::StatusOr<Frame> frame =
      world_->Expose(start, start + exposure, format.format, {options_.width, options_.height},
                     format.significant_bits, gain_db);
  if (!frame.ok()) {
    // A wrong picture would be worse, and nothing that a client can do leads here.
    spdlog::critical("simulated GigE camera: {}", frame.status().ToString());
    std::abort();
  }
  const size_t pixel =
      static_cast<size_t>(SamplesPerPixel(format.format)) * BytesPerSample(format.format);
  const size_t line = width * pixel;
  std::vector<std::byte> region(line * height);
  for (int row = 0; row < height; ++row) {
    size_t from = (static_cast<size_t>(top + row) * options_.width + left) * pixel;
    std::memcpy(region.data() + row * line, frame->data.data() + from, line);
  }
  const std::vector<std::byte> sent = Packed(std::move(region), format);
  size_t received = 0;  // by a buffer that is to be sent: nothing
  std::memcpy(const_cast<void*>(arv_buffer_get_data(buffer, &received)), sent.data(), sent.size());
}

}  // namespace lightstage::sim
