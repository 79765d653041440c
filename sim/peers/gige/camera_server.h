// A GigE Vision camera on a network interface whose picture is the simulated rig's: Aravis' embeddable fake camera speaks GVCP and
// GVSP, a sim::World makes the frames. What a real camera's driver can be shown without a camera.
//
// An exposure begins when the camera gets its trigger (up to 5 ms after the command was acknowledged), lasts its time on the
// world's clock, and integrates the light and motion of just that time.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "sim/peers/gige/chunk_relay.h"
#include "sim/rig/world.h"

typedef struct _ArvBuffer ArvBuffer;
typedef struct _ArvGvFakeCamera ArvGvFakeCamera;

namespace lightstage::sim {

struct GigeCameraOptions {
  std::string address = "127.0.0.1";  // IPv4, of the interface to serve on; port 3956
  std::string serial = "SIM01";
  int width = 0, height = 0;  // of the sensor, even
  int bits = 12;              // of a sample in the deep formats: 10, 12 or 16
  // How the deep Mono and Bayer formats lie in memory: "" in 16 bits, "p" the lowest bit first without a gap, "Packed" as GigE Vision
  // has it (2 samples in 3 bytes). Not with 16 bits.
  std::string packing;
  bool exposure_events =
      false;                // tells the end of each exposure on its message channel, if it is to
  bool chunk_data = false;  // can say with a frame how it was exposed; has its gain in dB then
};

class GigeCameraServer {
 public:
  // The camera does not answer while it exposes, and a client gives up control after 5 s without an answer.
  static constexpr Duration kMaxExposure = std::chrono::seconds(2);
  // Nor while it makes the picture, on a machine that has other things to do.
  static constexpr Duration kLongestSilence = std::chrono::seconds(10);

  // The world must be on real time. UNAVAILABLE / PEER_NOT_STARTED if the port is taken or no interface has the address.
  static absl::StatusOr<std::unique_ptr<GigeCameraServer>> Start(const GigeCameraOptions& options,
                                                                 std::shared_ptr<World> world);
  // This share of the packets of its stream gets lost from now on, 0 to 1. Any thread.
  void LosePackets(double ratio);

  // From now on, or no longer, the camera drops a client with its next word; the client sees it with its next heartbeat, within a second. Any
  // thread.
  void DropControl(bool on);

  // What frames say of their exposure is so many times the truth. Any thread.
  void Misreport(double factor) { misreport_ = factor; }
  // From the end of an exposure until its frame is sent. Any thread.
  void SetReadout(Duration readout) { readout_ = readout; }
  // The id of the frame that events name is so far off: as of an event that comes late. Any thread.
  void MisnumberEvents(int by) { event_offset_ = by; }
  // An edge on Line1: triggers, if the client has chosen it as source. Any thread.
  void PulseLine();
  // Ends of exposures that the client has acknowledged. Any thread.
  int events_acknowledged() const { return events_acknowledged_; }
  // Whether Line2 puts out that the sensor gathers light.
  bool ShowsExposure() const;

  // Waits for the picture being made.
  ~GigeCameraServer();

 private:
  GigeCameraServer(const GigeCameraOptions& options, std::shared_ptr<World> world);
  absl::Status StartRelay();
  ChunkRelay::Frame RelayedFrame() const;
  bool TendStream(uint16_t port);
  void TellExposureEnd(uint64_t frame_id);
  void Expose(ArvBuffer* buffer, Duration exposure, double gain_db, uint32_t code);

  const GigeCameraOptions options_;
  const std::shared_ptr<World> world_;  // shared with the rig's simulated devices
  std::atomic<bool> stopping_{false};
  std::atomic<double> misreport_{1};
  std::atomic<Duration> readout_{Duration::zero()};
  std::atomic<int> event_offset_{0};
  int events_socket_ = -1;
  uint16_t events_told_ = 0;  // the camera's thread only
  std::atomic<int> events_acknowledged_{0};
  std::atomic<double> exposure_us_{0}, gain_db_{0};  // of the last frame
  ArvGvFakeCamera* camera_ = nullptr;
  std::unique_ptr<ChunkRelay> relay_;
};

}  // namespace lightstage::sim
