// Whether a GigE Vision camera is still there. libaravis notices that one does not answer after up to 6 s; this asks more often, on a socket
// of its own: every GigE Vision device answers whoever reads a register.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "drivers/aravis/gvcp.h"

namespace lightstage {

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
  GvcpWatch(GvcpSocket socket, Duration patience, std::function<void(const std::string&)> lost);
  void Watch();
  enum class Heard { kNothing, kControlled, kUncontrolled, kEnd };
  // Sends a question and hears what comes within `patience`.
  Heard Ask(uint16_t id, Duration patience) const;

  const GvcpSocket socket_;
  const Duration patience_;
  const std::function<void(const std::string&)> lost_;
  std::thread thread_;
};

}  // namespace lightstage
