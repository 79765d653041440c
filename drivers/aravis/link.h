// One camera behind libaravis, as blocking calls. All methods belong to one thread, the device's; only the Events come from
// libaravis' own threads. Errors: DEADLINE_EXCEEDED / DEVICE_SILENT, UNAVAILABLE / DEVICE_LOST, INTERNAL / DEVICE_FAULT.
#pragma once

#include <netinet/in.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/base/thread_annotations.h"
#include "base/mutex.h"
#include "drivers/api/registry.h"
#include "drivers/aravis/capabilities.h"
#include "drivers/aravis/options.h"
#include "drivers/aravis/stream_counts.h"

typedef struct _ArvBuffer ArvBuffer;
typedef struct _ArvCamera ArvCamera;
typedef struct _ArvChunkParser ArvChunkParser;
typedef struct _ArvStream ArvStream;
struct _GError;

namespace lightstage {

class GvcpEventChannel;
class GvcpWatch;
class LastReference;

// What answers on the network and on the USB. One thread at a time, and none that has a link open meanwhile.
std::vector<Discovered> DiscoverAravis();

class AravisLink {
 public:
  // Called from libaravis' threads: must be short and must not call back. `session` counts the starts of the stream.
  struct Events {
    std::function<void(uint64_t session, TimePoint)> first_packet;  // of a frame
    std::function<void(uint64_t session)> buffer_done;              // TakeBuffer() has something
    // Of cameras that tell it: of which frame, and when that arrived.
    std::function<void(uint64_t frame_id, TimePoint)> exposure_ended;
    std::function<void(const std::string& why)> lost;
  };

  // Connects, takes control and puts the camera into a known state: no automatic exposure or gain, no binning, stopped.
  // NOT_FOUND / DEVICE_NOT_FOUND; FAILED_PRECONDITION / DEVICE_UNSUITABLE if it can not be used this way.
  static absl::StatusOr<std::unique_ptr<AravisLink>> Open(const AravisOptions& options,
                                                          const std::string& name, Clock& clock,
                                                          Events events);
  // Ends the stream and gives up control; takes seconds if the camera does not answer. No event comes after it.
  ~AravisLink();

  const AravisCapabilities& capabilities() const { return capabilities_; }

  // Applies a valid configuration and reads it back.
  absl::StatusOr<CameraConfig> Configure(const CameraConfig& config);

  // Gets buffers, turns the trigger on and starts; then takes a frame that nobody sees, because the first frame of a
  // session may arrive incomplete.
  absl::Status StartStream(const CameraConfig& config, TimePoint deadline);
  // Best effort; the stream's threads have ended afterwards.
  void StopStream();
  uint64_t session() const { return session_; }
  // What the next frame's id should be, if none is lost; 0: none has come yet.
  uint64_t next_frame_id() const;

  // What the camera really uses. Costs nothing if it is already set.
  absl::StatusOr<Duration> SetExposure(Duration exposure);
  // By software, or the line is listened to from now on, until Triggered().
  absl::Status Trigger();
  // The frame has come: further pulses on the line count for nothing.
  absl::Status Triggered();

  // A frame or lost frame (DATA_LOSS / FRAME_INCOMPLETE; DATA_LOSS / FRAME_EXPOSURE if it says of itself that it was not exposed as
  // set) and when its first packet came. The times of the exposure are left to the caller.
  struct Taken {
    TimePoint first_packet;
    absl::StatusOr<Frame> frame;
  };
  // The next one; nothing if there is none yet.
  std::optional<Taken> TakeBuffer();

 private:
  AravisLink(const AravisOptions& options, std::string name, Clock& clock, Events events);
  // OK if there is no error. Notes a camera that does not answer.
  absl::Status Check(const _GError* error, std::string_view operation);
  absl::Status Unsuitable(const std::string& message) const;
  // The values that an enumeration has; empty if there is no such feature.
  std::vector<std::string> Choices(const char* feature) const;
  // Sets an enumeration to what the rig file's `key` asks for.
  absl::Status Choose(const char* feature, const std::string& value, std::string_view key);
  absl::Status Connect();
  absl::Status WatchGigE();
  absl::Status ReadCapabilities();
  absl::Status ReadFormats();
  absl::Status ReadGain();
  absl::Status Prepare();
  absl::Status PrepareLines();
  absl::Status PrepareChunks();
  absl::Status PrepareEvents();
  absl::Status WriteRegister(uint32_t address, uint32_t value);
  // Of a GigE camera.
  absl::StatusOr<sockaddr_in> Address();
  absl::Status ReadChunks(ArvBuffer* buffer, Frame& frame);
  absl::Status CreateStream();
  absl::Status TurnTriggerOn();
  absl::Status SoftwareTrigger();
  absl::Status WarmUp(TimePoint deadline);
  StreamCounts Counts() const;
  absl::StatusOr<Frame> ToFrame(ArvBuffer* buffer);
  uint64_t NextSequence(uint64_t frame_id);
  Taken Take(ArvBuffer* buffer);
  static void OnStream(void* self, int type);

  const AravisOptions options_;
  const std::string name_;
  Clock& clock_;
  const Events events_;
  ArvCamera* camera_ = nullptr;
  std::unique_ptr<LastReference> last_reference_;  // of its device
  unsigned long lost_handler_ = 0;
  std::unique_ptr<GvcpWatch> watch_;                 // of a GigE camera
  std::unique_ptr<GvcpEventChannel> event_channel_;  // of one that tells the ends of its exposures
  std::atomic<bool> answers_{true};                  // else it is no use asking the camera anything
  std::atomic<bool> reporting_{false};               // events are wanted
  AravisCapabilities capabilities_;
  ArvChunkParser* chunks_ = nullptr;  // if frames are to say something of themselves
  bool exposure_chunk_ = false, gain_chunk_ = false;  // and what

  ArvStream* stream_ = nullptr;
  uint64_t session_ = 0;
  StreamCountsLog counts_log_;
  CameraConfig config_;
  std::optional<Duration> asked_exposure_;  // last one set, if it is still there
  Duration used_exposure_{};
  std::optional<uint64_t> last_frame_id_;  // of this session
  Mutex starts_mutex_;
  std::deque<TimePoint> starts_
      ABSL_GUARDED_BY(starts_mutex_);  // of frames begun and not yet taken
  uint64_t sequence_ = 0;
};

}  // namespace lightstage
