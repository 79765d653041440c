#include "sim/peers/gige/chunk_relay.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "base/status.h"

namespace lightstage::sim {
namespace {

constexpr size_t kHeader = 8;                   // status, block id, format, packet id
constexpr size_t kFormatAt = 4;                 // 1: leader, 2: trailer, 3: data
constexpr size_t kPacketIdAt = 5;               // 24 bits
constexpr size_t kPayloadTypeAt = kHeader + 2;  // of a leader
constexpr std::byte kChunksFollow{0x40};        // in the type's upper byte
constexpr uint32_t kImageChunk = 1;
constexpr int kLookMs = 2;

void PutBig(uint32_t value, std::vector<std::byte>& out) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out.push_back(static_cast<std::byte>(value >> shift));
}

uint32_t PacketId(const Packet& packet) {
  uint32_t id = 0;
  for (size_t i = 0; i < 3; ++i) id = id << 8 | static_cast<uint32_t>(packet[kPacketIdAt + i]);
  return id;
}

Packet WithId(Packet packet, uint32_t id) {
  for (size_t i = 0; i < 3; ++i)
    packet[kPacketIdAt + i] = static_cast<std::byte>(id >> (16 - 8 * i));
  return packet;
}

// Every chunk is its data, then its id and its length; the image is the first one.
void Append(const std::vector<Chunk>& chunks, uint32_t image_bytes, std::vector<std::byte>& out) {
  PutBig(kImageChunk, out);
  PutBig(image_bytes, out);
  for (const Chunk& chunk : chunks) {
    out.insert(out.end(), chunk.data.begin(), chunk.data.end());
    PutBig(chunk.id, out);
    PutBig(static_cast<uint32_t>(chunk.data.size()), out);
  }
}

}  // namespace

std::vector<Packet> ChunkAppender::Next(Packet packet, const std::vector<Chunk>& chunks,
                                        size_t block) {
  if (chunks.empty() || packet.size() < kHeader) {
    held_.clear();
    return {std::move(packet)};
  }
  switch (static_cast<int>(packet[kFormatAt])) {
    case 1:
      held_.clear();
      packet[kPayloadTypeAt] |= kChunksFollow;
      return {std::move(packet)};
    case 2:
      return End(std::move(packet), chunks, block);
    default:
      std::swap(held_, packet);
      return packet.empty() ? std::vector<Packet>{} : std::vector<Packet>{std::move(packet)};
  }
}

std::vector<Packet> ChunkAppender::End(Packet trailer, const std::vector<Chunk>& chunks,
                                       size_t block) {
  Packet last = std::exchange(held_, {});
  if (last.empty()) return {std::move(trailer)};
  uint32_t id = PacketId(last);
  if (id + 1 != PacketId(trailer)) return {std::move(last), std::move(trailer)};
  const Packet header(last.begin(), last.begin() + kHeader);
  std::vector<std::byte> data(last.begin() + kHeader, last.end());
  Append(chunks, static_cast<uint32_t>((id - 1) * block + data.size()), data);
  std::vector<Packet> packets;
  for (size_t from = 0; from < data.size(); from += block) {
    Packet& packet = packets.emplace_back(WithId(header, id++));
    const size_t to = std::min(from + block, data.size());
    packet.insert(packet.end(), data.begin() + static_cast<ptrdiff_t>(from),
                  data.begin() + static_cast<ptrdiff_t>(to));
  }
  packets.push_back(WithId(std::move(trailer), id));
  return packets;
}

absl::StatusOr<std::unique_ptr<ChunkRelay>> ChunkRelay::Start(
    const std::string& address, std::function<Frame()> frame,
    std::function<bool(uint16_t port)> tend) {
  sockaddr_in at = {};
  at.sin_family = AF_INET;
  inet_pton(AF_INET, address.c_str(), &at.sin_addr);
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return ErrnoError(errno, "opening", "a UDP socket");
  socklen_t size = sizeof at;
  if (bind(fd, reinterpret_cast<sockaddr*>(&at), sizeof at) != 0 ||
      getsockname(fd, reinterpret_cast<sockaddr*>(&at), &size) != 0) {
    const absl::Status failed = ErrnoError(errno, "binding a UDP socket to", address);
    close(fd);
    return failed;
  }
  return std::unique_ptr<ChunkRelay>(
      new ChunkRelay(fd, ntohs(at.sin_port), std::move(frame), std::move(tend)));
}

ChunkRelay::ChunkRelay(int socket, uint16_t port, std::function<Frame()> frame,
                       std::function<bool(uint16_t port)> tend)
    : socket_(socket),
      port_(port),
      frame_(std::move(frame)),
      tend_(std::move(tend)),
      thread_([this] { Run(); }) {}

ChunkRelay::~ChunkRelay() {
  stopping_ = true;
  thread_.join();
  close(socket_);
}

void ChunkRelay::Run() {
  ChunkAppender appender;
  Packet packet;
  while (!stopping_) {
    if (tend_(port_)) {
      while (recv(socket_, packet.data(), packet.size(), MSG_DONTWAIT) >= 0) {
      }
    }
    pollfd ready = {socket_, POLLIN, 0};
    if (poll(&ready, 1, kLookMs) <= 0) continue;
    packet.resize(65536);
    const ssize_t got = recv(socket_, packet.data(), packet.size(), 0);
    if (got < 0) continue;
    packet.resize(static_cast<size_t>(got));
    const Frame frame = frame_();
    for (const Packet& out : appender.Next(packet, frame.chunks, frame.block)) {
      // What gets lost here is lost on the wire.
      (void)sendto(socket_, out.data(), out.size(), 0,
                   reinterpret_cast<const sockaddr*>(&frame.client), sizeof frame.client);
    }
  }
}

}  // namespace lightstage::sim
