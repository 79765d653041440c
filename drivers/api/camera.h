// One camera. Order of calls: Configure → Arm → any number of triggers → Disarm.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/api/device.h"

namespace lightstage {

// Names follow GenICam's Pixel Format Naming Convention. 16-bit samples are little-endian in the low bits of 16.
enum class PixelFormat {
  kMono8,
  kMono16,
  kBayerRG8,
  kBayerGR8,
  kBayerGB8,
  kBayerBG8,
  kBayerRG16,
  kBayerGR16,
  kBayerGB16,
  kBayerBG16,
  kRGB8,
  kRGB16
};

std::string_view PixelFormatName(PixelFormat format);  // "Mono8", "BayerRG16", …
absl::StatusOr<PixelFormat> ParsePixelFormat(std::string_view name);
int BytesPerSample(PixelFormat format);   // 1 or 2
int SamplesPerPixel(PixelFormat format);  // 3 for RGB, else 1
bool IsBayer(PixelFormat format);

// Where a region of `size` begins, so that it is centred on a sensor of `sensor` samples as well as `step` allows.
int CentredOffset(int sensor, int size, int step);

// Clamps one side of a region to [min, max] and rounds it down to min + n · step; a change becomes a line in `notes`, as ConfigResult has
// them. False, with a note, if it can not be meant: below 1.
bool FitSide(const char* field, int min, int max, int step, int& value,
             std::vector<std::string>& notes);

struct CameraInfo {
  DeviceIdentity identity;
  int sensor_width = 0, sensor_height = 0;
  std::vector<PixelFormat> formats;
  Duration min_exposure{}, max_exposure{};
  Duration exposure_step{};  // granularity; 0 if unknown
  double min_gain_db = 0, max_gain_db = 0;
  Duration readout{};  // from exposure end until it can expose again, full frame
};

struct CameraConfig {
  PixelFormat format = PixelFormat::kMono8;
  int width = 0, height = 0;  // of the centred region of interest
  double gain_db = 0;
  bool operator==(const CameraConfig&) const = default;
};

enum class ConfigVerdict {
  kValid,  // taken as asked
  kAdjusted,  // usable after the changes listed in `notes`; `config` is what the camera would really do
  kInvalid,  // cannot be made to work; `notes` say why
};

struct ConfigResult {
  ConfigVerdict verdict = ConfigVerdict::kInvalid;
  CameraConfig config;
  std::vector<std::string> notes;  // one line each: which field, asked value, real value
};

// What the camera would really do with an asked exposure time, and whether that is what was asked (within its step).
struct ExposureResult {
  ConfigVerdict verdict = ConfigVerdict::kInvalid;
  Duration exposure{};
  std::string note;  // empty if valid
};

// A complete frame. Frames that lost data are never delivered: they are an error, DATA_LOSS / FRAME_INCOMPLETE.
struct Frame {
  PixelFormat format = PixelFormat::kMono8;
  int width = 0, height = 0;
  int significant_bits = 8;                    // full scale is 2^significant_bits − 1
  std::vector<std::byte> data;                 // rows without padding, top first
  Duration exposure{};                         // really used
  double gain_db = 0;                          // really used
  TimePoint exposure_start{}, exposure_end{};  // rig clock, as well as the driver can tell
  int64_t device_timestamp_ns = 0;             // the camera's own clock
  uint64_t sequence = 0;                       // the camera's own frame count
  // Of a camera that runs freely: when the exposure of its first row began if its latency were 0; by that much it began earlier. Nothing for
  // cameras that expose when they are triggered.
  std::optional<TimePoint> latest_start;
};

// When the light of one exposure has been gathered: from here on light and pose may change.
struct ExposureEnd {
  TimePoint time{};
};

class Camera {
 public:
  virtual ~Camera() = default;

  virtual const CameraInfo& info() const = 0;

  // What Configure would do. Any thread; does not touch the device.
  virtual ConfigResult Validate(const CameraConfig& config) const = 0;
  virtual ExposureResult ValidateExposure(Duration exposure) const = 0;

  // Applies `config`, which must validate as kValid, and reads it back. Not while armed.
  virtual void Configure(const CameraConfig& config, TimePoint deadline,
                         Completion<CameraConfig> done) = 0;

  // Gets buffers and starts the stream, ready for software triggers.
  virtual void Arm(TimePoint deadline, Completion<CameraConfig> done) = 0;

  // Takes one frame of `exposure`. `exposure_ended` fires when the sensor has stopped gathering light, `frame_ready` when the data
  // are here; each exactly once, in that order; a failed exposure fails both. A trigger before the last frame is ready is
  // FAILED_PRECONDITION / CAMERA_BUSY. Errors: DATA_LOSS / FRAME_INCOMPLETE, DEADLINE_EXCEEDED / DEVICE_SILENT,
  // UNAVAILABLE / DEVICE_LOST.
  virtual void Trigger(Duration exposure, TimePoint deadline,
                       Completion<ExposureEnd> exposure_ended, Completion<Frame> frame_ready) = 0;

  // Any thread. Ends the stream; what is outstanding completes with CANCELLED.
  virtual void Disarm(TimePoint deadline, Completion<CameraConfig> done) = 0;
};

}  // namespace lightstage
