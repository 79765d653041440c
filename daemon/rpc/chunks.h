// Sends `bytes` as messages with `total_bytes` and `data`, at least one, each within gRPC's default message limit.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "absl/functional/function_ref.h"
#include "grpcpp/support/sync_stream.h"

namespace lightstage::rpc {

inline constexpr size_t kChunkBytes = 1 << 20;

// False if the client has gone. `decorate` adds to the first message.
template <class Message>
bool WriteChunks(grpc::ServerWriter<Message>& writer, std::string_view bytes,
                 absl::FunctionRef<void(Message&)> decorate) {
  size_t at = 0;
  do {
    Message message;
    message.set_total_bytes(static_cast<int64_t>(bytes.size()));
    std::string_view part = bytes.substr(at, kChunkBytes);
    message.set_data(part.data(), part.size());
    if (at == 0) decorate(message);
    if (!writer.Write(message)) return false;
    at += part.size();
  } while (at < bytes.size());
  return true;
}

}  // namespace lightstage::rpc
