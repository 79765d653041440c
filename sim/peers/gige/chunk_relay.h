// Chunk data for Aravis' fake camera, which knows none: its stream goes through here on its way to the client, and every frame gets
// appended what it says of itself. Packets are GigE Vision's (GVSP, 16-bit block ids).
#pragma once

#include <netinet/in.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"

namespace lightstage::sim {

using Packet = std::vector<std::byte>;

struct Chunk {
  uint32_t id = 0;
  std::vector<std::byte> data;
};

// The packets of one stream, one after the other.
class ChunkAppender {
 public:
  // What is to be sent instead of `packet`, with at most `block` bytes of data in each. `chunks` are those of the packet's frame; none: it
  // passes as it is. A frame that lost its last block has no place for them, and stays incomplete.
  std::vector<Packet> Next(Packet packet, const std::vector<Chunk>& chunks, size_t block);

 private:
  std::vector<Packet> End(Packet trailer, const std::vector<Chunk>& chunks, size_t block);

  Packet held_;  // the last block of data: the frame may end after it
};

class ChunkRelay {
 public:
  struct Frame {
    sockaddr_in client{};       // where its packets go
    size_t block = 0;           // bytes of data in a packet
    std::vector<Chunk> chunks;  // none: passed as it is
  };
  // On the relay's thread `frame` is asked for every packet, and `tend` is called at least every 2 ms, with port(). Where it answers
  // true a stream has ended: what of it has not been passed on is dropped.
  static absl::StatusOr<std::unique_ptr<ChunkRelay>> Start(const std::string& address,
                                                           std::function<Frame()> frame,
                                                           std::function<bool(uint16_t port)> tend);
  ~ChunkRelay();
  uint16_t port() const { return port_; }  // where the camera's packets go

 private:
  ChunkRelay(int socket, uint16_t port, std::function<Frame()> frame,
             std::function<bool(uint16_t port)> tend);
  void Run();

  const int socket_;
  const uint16_t port_;
  const std::function<Frame()> frame_;
  const std::function<bool(uint16_t port)> tend_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace lightstage::sim
