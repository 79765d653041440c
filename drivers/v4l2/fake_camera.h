// A camera and the kernel's side of it, for tests: it runs freely in real time with a rolling shutter, sees a light that the test turns up
// and down, and fails as asked. It shares no code with the driver: pictures are packed here from the kernel's documentation alone.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/functional/function_ref.h"
#include "base/mutex.h"
#include "drivers/v4l2/video_device.h"

namespace lightstage {

struct FakeControl {
  uint32_t id = 0;
  std::string name;
  int64_t min = 0, max = 1, step = 1, value = 0;
  uint32_t flags = 0;
  bool stuck = false;                    // takes every value and keeps its own
  std::optional<int64_t> default_value;  // not given: min
};

struct FakeFormat {
  uint32_t fourcc = 0;
  std::vector<std::pair<int, int>>
      sizes;  // one: the greatest of a range in steps of 2; more: discrete
};

// When a frame is stamped, and what the buffer's flags say of it.
enum class FakeStamp {
  kEndOfFrame,    // when all of it is there
  kFirstPacket,   // when it begins to come, flagged as start of exposure, as uvcvideo does
  kExposure,      // when the exposure of its first row began
  kFuture,        // nine tenths of a frame too late, as vivid does
  kUnknownClock,  // a number that means nothing
};

struct FakeSetup {
  std::string driver = "fakevideo", card = "Test camera", bus_info = "usb-0000:00:14.0-1";
  std::vector<FakeFormat> formats;
  std::vector<FakeControl> controls;
  bool crops = false;  // a region, in steps of 4
  bool composes =
      false;  // leaves the picture in a quarter of the frame unless it is told otherwise
  Duration interval = std::chrono::milliseconds(20);
  bool tells_interval = true;
  Duration readout = std::chrono::milliseconds(6);          // from the first to the last row
  Duration transport = std::chrono::milliseconds(4);        // to the computer
  Duration fixed_exposure = std::chrono::milliseconds(10);  // without a control for it
  int exposure_delay_frames = 2;                            // until a new exposure shows
  FakeStamp stamp = FakeStamp::kEndOfFrame;
  int line_padding = 0;
  uint32_t first_sequence = 0;
  bool pattern = false;  // shows FakeSample() of fake_picture.h instead of the light
  // Compresses a picture, instead of PackLine() of fake_picture.h.
  std::function<std::vector<uint8_t>(int width, int height,
                                     absl::FunctionRef<unsigned(int x, int y, int c)> sample)>
      compress;
  uint32_t quantization = 0, ycbcr_enc = 0, colorspace = 8 /* sRGB */;
  uint32_t field = 1 /* progressive */;
  bool metadata_node = false;  // it is one that has no pictures
  bool multi_planar = false;
};

class FakeCamera {
 public:
  explicit FakeCamera(FakeSetup setup);
  ~FakeCamera();

  const FakeSetup& setup() const { return setup_; }

  // One more descriptor. 0 or errno.
  int Open(std::unique_ptr<VideoDevice>* device);

  // The light from now on, 0 to 1.
  void SetLight(double level);

  // ---- Faults
  void Unplug();  // what is open answers ENODEV from now on
  void PlugIn();  // again; what was open stays dead
  bool plugged() const;
  void FailNext(unsigned long request, int error, int times = 1);
  bool fails_next(unsigned long request) const;
  void SetSilent(bool silent);  // no frames, and nobody says why
  void BreakStream();           // as vb2_queue_error(): POLLERR and EIO until the stream is ended
  // As uvcvideo after a failed transfer: all buffers come back empty, no frame follows.
  void CancelBuffers();
  void DropNext(int frames);                    // numbered, but never delivered
  void DamageNext(int frames);                  // V4L2_BUF_FLAG_ERROR
  void ShortenNext(int frames, int bytes = 1);  // too few
  void NumberNextBack(uint32_t by);             // its number, and those after it
  void SetStamp(FakeStamp stamp);
  void SetControl(uint32_t id, int64_t value);
  int64_t control(uint32_t id) const;

  // ---- What is held
  int open_handles() const;
  int mappings() const;
  int streams_started() const;
  int delivered() const;  // frames that were dequeued
  std::pair<int, int> region_at() const;

 private:
  friend class FakeHandle;
  struct Buffer {
    std::vector<std::byte> memory;
    uint32_t used = 0, sequence = 0, flags = 0;
    int64_t stamp_us = 0;
  };

  int Do(uint64_t epoch, unsigned long request, void* argument);
  int Enumerate(unsigned long request, void* argument) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int Format(unsigned long request, void* argument) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int Control(unsigned long request, void* argument) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int Stream(unsigned long request, void* argument) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  int SetFormat(void* argument) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void FillFormat(void* argument) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  FakeControl* FindControl(uint32_t id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  VideoDevice::Readiness Ready(uint64_t epoch) const;

  void Run();
  void Produce(TimePoint complete) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Paint(Buffer& buffer, TimePoint read_from, Duration exposure)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Duration ExposureAt(TimePoint time) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  double Light(TimePoint from, TimePoint to) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Signal() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  RealClock clock_;
  const FakeSetup setup_;
  const int ready_fd_;  // readable when something may have changed for who waits
  mutable Mutex mutex_;
  CondVar changed_;
  std::vector<FakeControl> controls_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::pair<TimePoint, double>> light_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::pair<TimePoint, Duration>> exposures_ ABSL_GUARDED_BY(mutex_);
  uint32_t fourcc_ ABSL_GUARDED_BY(mutex_) = 0;
  int width_ ABSL_GUARDED_BY(mutex_) = 0, height_ ABSL_GUARDED_BY(mutex_) = 0;
  int crop_[4] ABSL_GUARDED_BY(mutex_) = {};  // left, top, width, height
  uint32_t composed_[2] ABSL_GUARDED_BY(mutex_) = {};
  Duration interval_ ABSL_GUARDED_BY(mutex_);
  FakeStamp stamp_ ABSL_GUARDED_BY(mutex_);

  std::vector<std::unique_ptr<Buffer>> buffers_ ABSL_GUARDED_BY(mutex_);
  std::deque<uint32_t> queued_ ABSL_GUARDED_BY(mutex_), done_ ABSL_GUARDED_BY(mutex_);
  bool streaming_ ABSL_GUARDED_BY(mutex_) = false, broken_ ABSL_GUARDED_BY(mutex_) = false;
  bool cancelled_ ABSL_GUARDED_BY(mutex_) = false;
  TimePoint next_ ABSL_GUARDED_BY(mutex_);
  uint32_t sequence_ ABSL_GUARDED_BY(mutex_) = 0;

  bool plugged_ ABSL_GUARDED_BY(mutex_) = true;
  uint64_t epoch_ ABSL_GUARDED_BY(mutex_) = 1;
  std::map<unsigned long, std::pair<int, int>> failures_ ABSL_GUARDED_BY(mutex_);
  bool silent_ ABSL_GUARDED_BY(mutex_) = false;
  int drop_ ABSL_GUARDED_BY(mutex_) = 0, damage_ ABSL_GUARDED_BY(mutex_) = 0;
  int shorten_ ABSL_GUARDED_BY(mutex_) = 0, shorten_by_ ABSL_GUARDED_BY(mutex_) = 1;
  uint32_t back_ ABSL_GUARDED_BY(mutex_) = 0;
  int handles_ ABSL_GUARDED_BY(mutex_) = 0, mappings_ ABSL_GUARDED_BY(mutex_) = 0;
  int streams_ ABSL_GUARDED_BY(mutex_) = 0, delivered_ ABSL_GUARDED_BY(mutex_) = 0;
  bool quit_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace lightstage
