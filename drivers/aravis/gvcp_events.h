// A GigE Vision camera's message channel, on which it tells events as they happen (GigE Vision 2.0, 18); libaravis 0.8 has none.
#pragma once

#include <functional>
#include <memory>
#include <thread>

#include "drivers/aravis/gvcp.h"

namespace lightstage {

class GvcpEventChannel {
 public:
  // `event` is called with an event and when it arrived, on a thread of the channel; must be short. An event that the camera sends again,
  // because our acknowledgement was lost, is told once.
  static absl::StatusOr<std::unique_ptr<GvcpEventChannel>> Open(
      const sockaddr_in& camera, Clock& clock,
      std::function<void(const GvcpEvent&, TimePoint)> event);
  // No call comes after it.
  ~GvcpEventChannel();

  // Where the camera is to send them.
  sockaddr_in address() const { return socket_.address(); }

 private:
  GvcpEventChannel(GvcpSocket socket, const sockaddr_in& camera, Clock& clock,
                   std::function<void(const GvcpEvent&, TimePoint)> event);
  void Listen();

  const GvcpSocket socket_;
  const in_addr camera_;
  Clock& clock_;
  const std::function<void(const GvcpEvent&, TimePoint)> event_;
  std::thread thread_;
};

}  // namespace lightstage
