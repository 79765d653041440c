// A USB Video Class camera's control side: its descriptors, the exposure and gain that are set, and what the host has negotiated and begun to
// stream. What it sees is camera_server.h's business.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "base/clock.h"
#include "base/mutex.h"
#include "sim/peers/uvc/descriptors.h"
#include "sim/peers/uvc/usbip.h"

namespace lightstage::sim {

struct UvcCameraOptions {
  std::string product;  // ASCII, at most 31 characters: the kernel keeps no more
  int width = 0, height = 0;
  int bits = 16;  // significant ones of 16
  Duration frame_interval = std::chrono::milliseconds(33);
  double gain_db_per_step = 1;
  Duration
      latency{};  // from the end of an exposure and of its readout until the frame begins to be sent
  // The longest time from the end of the first row's exposure that a frame may take to be there and still be good; not given: any.
  std::optional<Duration> latency_limit;
};

// The most bytes of a payload with its header: what the host is told, and what ends a payload without a short packet.
constexpr size_t kUvcPayloadBytes = 16384;

class UvcCamera final : public UsbFunction {
 public:
  // `on_stream` is called, without a lock held, when a stream has begun or ended.
  UvcCamera(const UvcCameraOptions& options, std::function<void()> on_stream);

  std::optional<std::vector<uint8_t>> Control(const UsbSetup& setup,
                                              std::span<const uint8_t> data) override;

  // ---- For who exposes. Any thread.

  // The stream that the host wants, another number for each; 0: none.
  uint64_t stream() const { return stream_; }

  // What a frame that begins now has. Settings count for the frames that begin after them and no other: this is the moment.
  struct Shot {
    TimePoint start{};
    Duration exposure{};
    double gain_db = 0;
    PixelFormat format = PixelFormat::kMono16;
  };
  Shot Begin(const Clock& clock) const;

  // Fault on purpose: from now on no control is ready, so that each request stalls.
  void Stall(bool stalls) { stalls_ = stalls; }

 private:
  using Answer = std::optional<std::vector<uint8_t>>;

  Answer Standard(const UsbSetup& setup);
  Answer Descriptor(const UsbSetup& setup) const;
  Answer Class(const UsbSetup& setup, std::span<const uint8_t> data);
  Answer Unit(const UsbSetup& setup, std::span<const uint8_t> data)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Answer Negotiate(const UsbSetup& setup, std::span<const uint8_t> data)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // A stalled request's reason is asked for afterwards.
  Answer Refuse(uint8_t why) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::vector<uint8_t> Negotiated(uint8_t format) const;
  void SetStream(bool streams);

  const UvcCameraOptions options_;
  const UvcDescription description_;
  const std::function<void()> on_stream_;
  std::atomic<uint64_t> stream_{0};
  std::atomic<bool> stalls_{false};

  mutable Mutex mutex_;
  uint8_t configuration_ ABSL_GUARDED_BY(mutex_) = 0;
  uint8_t error_ ABSL_GUARDED_BY(mutex_) = 0;
  uint8_t exposure_mode_ ABSL_GUARDED_BY(mutex_);
  uint32_t exposure_ ABSL_GUARDED_BY(mutex_);  // 100 µs
  uint32_t gain_ ABSL_GUARDED_BY(mutex_) = 0;  // steps
  uint8_t probed_ ABSL_GUARDED_BY(mutex_) = 1, committed_ ABSL_GUARDED_BY(mutex_) = 1;
  uint64_t streams_ ABSL_GUARDED_BY(mutex_) = 0;  // ever
};

}  // namespace lightstage::sim
