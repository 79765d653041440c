// Whether a GigE Vision camera is still there. libaravis notices that one does not answer after up to 6 s; this asks more often, on a socket
// of its own: every GigE Vision device answers whoever reads a register (GigE Vision 2.0, 16: READREG_CMD).
#pragma once

#include <netinet/in.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "base/clock.h"

namespace lightstage {

// Where GigE Vision devices listen.
constexpr uint16_t kGvcpPort = 3956;

// GVCP on the wire, big-endian: a question for one register, and the value in its answer; nothing if that is no answer to question `id`.
// A refusal is an answer without a value: 0 is returned for it with `refused`.
std::array<std::byte, 12> EncodeReadRegister(uint16_t id, uint32_t address);
struct GvcpAnswer {
  bool refused = false;
  uint32_t value = 0;
};
std::optional<GvcpAnswer> DecodeReadRegister(std::span<const std::byte> packet, uint16_t id);

class GvcpWatch {
 public:
  // Four questions in a row without an answer, `patience` in all, are a loss, and so is a camera that nobody controls (it was restarted, or
  // gave control up by itself). `lost` is called once then, on a thread of the watch, and must not destroy it.
  static absl::StatusOr<std::unique_ptr<GvcpWatch>> Start(
      const sockaddr_in& camera, Duration patience,
      std::function<void(const std::string& why)> lost);
  // No call comes after it.
  ~GvcpWatch();

 private:
  GvcpWatch(int socket, int stop, Duration patience, std::function<void(const std::string&)> lost);
  void Watch();
  // Sends a question and waits for its answer, at most for `patience`; nothing if the watch ends.
  enum class Heard { kNothing, kControlled, kUncontrolled, kEnd };
  Heard Ask(uint16_t id, Duration patience) const;

  const int socket_, stop_;
  const Duration patience_;
  const std::function<void(const std::string&)> lost_;
  std::thread thread_;
};

}  // namespace lightstage
