#include "sim/peers/gige/chunk_relay.h"

#include <gtest/gtest.h>

namespace lightstage::sim {
namespace {

Packet Bytes(std::initializer_list<int> values) {
  Packet packet;
  for (int value : values) packet.push_back(static_cast<std::byte>(value));
  return packet;
}

const Packet kLeader = Bytes({0, 0, 0, 7, 1, 0, 0, 0, 0, 0, 0, 1});
const Packet kFirst = Bytes({0, 0, 0, 7, 3, 0, 0, 1, 10, 11, 12, 13});
const Packet kSecond = Bytes({0, 0, 0, 7, 3, 0, 0, 2, 14, 15});
const Packet kTrailer = Bytes({0, 0, 0, 7, 2, 0, 0, 3, 0, 0, 0, 1});
const std::vector<Chunk> kChunks = {{0x101, Bytes({0xAA})}};

std::vector<Packet> All(const std::vector<Packet>& in, const std::vector<Chunk>& chunks,
                        size_t block) {
  ChunkAppender appender;
  std::vector<Packet> out;
  for (const Packet& packet : in) {
    for (Packet& sent : appender.Next(packet, chunks, block)) out.push_back(std::move(sent));
  }
  return out;
}

TEST(ChunkAppender, WithoutChunksNothingChanges) {
  const std::vector<Packet> frame = {kLeader, kFirst, kSecond, kTrailer};
  EXPECT_EQ(All(frame, {}, 4), frame);
}

// GigE Vision: chunk data, then its id and length, the image first; blocks are full but for the last.
TEST(ChunkAppender, ChunksFollowTheImage) {
  const std::vector<Packet> expected = {
      Bytes({0, 0, 0, 7, 1, 0, 0, 0, 0, 0, 0x40, 1}), kFirst,
      Bytes({0, 0, 0, 7, 3, 0, 0, 2, 14, 15, 0, 0}),  Bytes({0, 0, 0, 7, 3, 0, 0, 3, 0, 1, 0, 0}),
      Bytes({0, 0, 0, 7, 3, 0, 0, 4, 0, 6, 0xAA, 0}), Bytes({0, 0, 0, 7, 3, 0, 0, 5, 0, 1, 1, 0}),
      Bytes({0, 0, 0, 7, 3, 0, 0, 6, 0, 0, 1}),       Bytes({0, 0, 0, 7, 2, 0, 0, 7, 0, 0, 0, 1})};
  EXPECT_EQ(All({kLeader, kFirst, kSecond, kTrailer}, kChunks, 4), expected);
}

TEST(ChunkAppender, AFrameThatLostItsEndGetsNone) {
  Packet leader = kLeader;
  leader[10] = std::byte{0x40};
  EXPECT_EQ(All({kLeader, kFirst, kTrailer}, kChunks, 4),
            (std::vector<Packet>{leader, kFirst, kTrailer}));
  EXPECT_EQ(All({kLeader, kTrailer}, kChunks, 4), (std::vector<Packet>{leader, kTrailer}));
}

}  // namespace
}  // namespace lightstage::sim
