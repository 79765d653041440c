// A USB Video Class camera whose picture is the simulated rig's, on a USB/IP connection. It runs freely while the host streams: a frame is
// exposed, then read out and sent, and the next one begins no sooner than its time has come and the host has taken this one in. So whatever
// the host does with a frame, none that comes after it can have begun before it – also on a machine that is slow at making pictures.
//
// Frame k integrates the light and motion of just its exposure on the world's clock, with what was set when it began. Its first payload has no
// pixels yet: with that the host stamps it, so that the stamp is no later for the time that the picture takes to be computed.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "sim/peers/uvc/usbip.h"
#include "sim/peers/uvc/uvc_camera.h"
#include "sim/rig/world.h"

namespace lightstage::sim {

enum class UvcFault {
  kNone,
  kSilent,   // no frame comes
  kDamaged,  // what comes is wrong, and flagged so
  kShort,    // half of a frame's bytes are missing
  kSkips,    // of four frames one is sent
  kStalls,   // no control is ready
};

class UvcCameraServer {
 public:
  // `socket`: the device's end, closed with it. The world must be on real time.
  UvcCameraServer(const UvcCameraOptions& options, std::shared_ptr<World> world, int socket);
  ~UvcCameraServer();  // the host sees it unplugged
  UvcCameraServer(const UvcCameraServer&) = delete;
  UvcCameraServer& operator=(const UvcCameraServer&) = delete;

  // ---- Any thread.
  void Fail(UvcFault fault);  // until told otherwise
  // Fails the transfers that the host has asked for, as a disturbed wire does.
  void BreakTransfers();
  int frames() const { return frames_; }  // exposed so far
  absl::Status status() const { return connection_.status(); }

 private:
  void Run();
  void RunStream(uint64_t stream);
  bool Over(uint64_t stream) const { return quit_ || camera_.stream() != stream; }
  // The picture's bytes, or nothing if the light cannot be had.
  std::vector<uint8_t> Expose(const UvcCamera::Shot& shot);
  // Waits until the host has taken in all that it was sent, as it had `asked` for.
  void AwaitTaken(size_t asked, int broken, uint64_t stream);
  bool SendFrame(const UvcCamera::Shot& shot, bool odd, uint64_t stream);

  const UvcCameraOptions options_;
  const std::shared_ptr<World> world_;  // shared with the rig's other devices
  std::atomic<bool> quit_{false};
  std::atomic<UvcFault> fault_{UvcFault::kNone};
  std::atomic<int> frames_{0}, broken_{0};
  // A stream may begin before the connection's constructor is through.
  std::atomic<UsbipConnection*> waker_{nullptr};
  UvcCamera camera_;
  UsbipConnection connection_;
  std::thread thread_;
};

}  // namespace lightstage::sim
