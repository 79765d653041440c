#include "sim/peers/uvc/uvc_camera.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lightstage::sim {
namespace {

using std::chrono::microseconds;

// bmRequestType, bRequest and selectors: chapter 9, and the Video Class' tables.
constexpr uint8_t kIn = 0x80, kTypeMask = 0x60, kClassType = 0x20, kRecipientMask = 0x1f,
                  kToInterface = 1, kToEndpoint = 2;
constexpr uint8_t kGetStatus = 0, kClearFeature = 1, kSetAddress = 5, kGetDescriptor = 6,
                  kGetConfiguration = 8, kSetConfiguration = 9, kGetInterface = 10,
                  kSetInterface = 11;
constexpr uint8_t kSetCur = 0x01, kGetCur = 0x81, kGetMin = 0x82, kGetMax = 0x83, kGetRes = 0x84,
                  kGetLen = 0x85, kGetInfo = 0x86, kGetDef = 0x87;
constexpr uint8_t kErrorCodeControl = 2, kProbeControl = 1, kCommitControl = 2,
                  kExposureModeControl = 2, kExposureTimeControl = 4, kGainControl = 4;
// Of the request error code control.
constexpr uint8_t kNotReady = 1, kWrongState = 2, kOutOfRange = 4, kInvalidUnit = 5,
                  kInvalidControl = 6, kInvalidRequest = 7;

constexpr uint8_t kManual = 1, kAperturePriority = 8;
constexpr microseconds kExposureUnit{100};
constexpr double kMostGainDb = 24;

uint32_t Get(std::span<const uint8_t> data) {
  uint32_t value = 0;
  for (size_t i = data.size(); i-- > 0;) value = value << 8 | data[i];
  return value;
}

std::vector<uint8_t> Put(uint32_t value, size_t bytes) {
  std::vector<uint8_t> data;
  for (size_t i = 0; i < bytes; ++i) data.push_back(static_cast<uint8_t>(value >> 8 * i));
  return data;
}

// A control: a whole number of so many bytes.
struct Range {
  size_t bytes = 0;
  uint32_t min = 0, max = 0, step = 1, default_value = 0;
};

uint32_t LongestExposure(const UvcCameraOptions& options) {
  return static_cast<uint32_t>(std::max<int64_t>(1, options.frame_interval / kExposureUnit));
}

Range ExposureRange(const UvcCameraOptions& options) {
  const uint32_t most = LongestExposure(options);
  return {4, 1, most, 1, (most + 1) / 2};
}

Range GainRange(const UvcCameraOptions& options) {
  return {2, 0, static_cast<uint32_t>(std::min(kMostGainDb / options.gain_db_per_step, 65535.0))};
}

}  // namespace

UvcCamera::UvcCamera(const UvcCameraOptions& options, std::function<void()> on_stream)
    : options_(options),
      description_{options.product, options.width, options.height,
                   static_cast<uint32_t>(options.frame_interval.count() / 100)},
      on_stream_(std::move(on_stream)),
      exposure_mode_(kAperturePriority),  // as webcams come up
      exposure_(ExposureRange(options).default_value) {}

UvcCamera::Shot UvcCamera::Begin(const Clock& clock) const {
  MutexLock lock(&mutex_);
  // What would be automatic has nothing to go by: it takes the middle.
  const uint32_t exposure =
      exposure_mode_ == kManual ? exposure_ : ExposureRange(options_).default_value;
  return {clock.Now(), exposure * kExposureUnit, gain_ * options_.gain_db_per_step,
          kUvcFormats[committed_ - 1]};
}

void UvcCamera::SetStream(bool streams) {
  {
    MutexLock lock(&mutex_);
    stream_ = streams ? ++streams_ : 0;
  }
  on_stream_();
}

UvcCamera::Answer UvcCamera::Control(const UsbSetup& setup, std::span<const uint8_t> data) {
  const bool to_class = (setup.request_type & kTypeMask) == kClassType;
  Answer answer = to_class ? Class(setup, data) : Standard(setup);
  if (!answer) return answer;
  if ((setup.request_type & kIn) != 0) {
    answer->resize(std::min<size_t>(answer->size(), setup.length));
    return answer;
  }
  const uint8_t recipient = setup.request_type & kRecipientMask;
  const uint8_t selector = setup.value >> 8;
  if (to_class && (setup.index & 0xff) == kStreamInterface && selector == kCommitControl) {
    SetStream(true);
  } else if (!to_class && ((recipient == kToEndpoint && setup.request == kClearFeature) ||
                           setup.request == kSetInterface || setup.request == kSetConfiguration)) {
    // The Video Class does not say how a bulk stream ends. Hosts clear the endpoint's halt.
    SetStream(false);
  }
  return answer;
}

UvcCamera::Answer UvcCamera::Standard(const UsbSetup& setup) {
  const uint8_t recipient = setup.request_type & kRecipientMask;
  switch (setup.request) {
    case kGetDescriptor:
      return Descriptor(setup);
    case kGetStatus:
      return Put(0, 2);
    case kGetInterface:
      return Put(0, 1);
    case kSetInterface:  // there is one alternate setting
      return recipient == kToInterface && setup.value == 0 ? Answer(std::in_place) : std::nullopt;
    case kClearFeature:
    case kSetAddress:
      return Answer(std::in_place);
    default:
      break;
  }
  MutexLock lock(&mutex_);
  if (setup.request == kGetConfiguration) return Put(configuration_, 1);
  if (setup.request != kSetConfiguration || setup.value > 1) return std::nullopt;
  configuration_ = static_cast<uint8_t>(setup.value);
  return Answer(std::in_place);
}

UvcCamera::Answer UvcCamera::Descriptor(const UsbSetup& setup) const {
  constexpr int kDevice = 1, kConfiguration = 2, kString = 3;
  std::vector<uint8_t> descriptor;
  switch (setup.value >> 8) {
    case kDevice:
      return UvcDeviceDescriptor();
    case kConfiguration:
      return UvcConfigurationDescriptor(description_);
    case kString:
      descriptor = UvcStringDescriptor(description_, setup.value & 0xff);
      break;
    default:  // it knows no other speed
      break;
  }
  return descriptor.empty() ? std::nullopt : Answer(std::move(descriptor));
}

UvcCamera::Answer UvcCamera::Refuse(uint8_t why) {
  error_ = why;
  return std::nullopt;
}

UvcCamera::Answer UvcCamera::Class(const UsbSetup& setup, std::span<const uint8_t> data) {
  const uint8_t interface = setup.index & 0xff, unit = setup.index >> 8,
                selector = setup.value >> 8;
  MutexLock lock(&mutex_);
  if (interface == kControlInterface && unit == 0 && selector == kErrorCodeControl &&
      setup.request == kGetCur) {
    return Put(error_, 1);
  }
  if (stalls_) return Refuse(kNotReady);
  if (interface == kStreamInterface) return Negotiate(setup, data);
  return interface == kControlInterface ? Unit(setup, data) : Refuse(kInvalidUnit);
}

UvcCamera::Answer UvcCamera::Unit(const UsbSetup& setup, std::span<const uint8_t> data) {
  const uint8_t unit = setup.index >> 8, selector = setup.value >> 8;
  if (unit != kCameraTerminal && unit != kProcessingUnit) return Refuse(kInvalidUnit);
  const bool exposes = unit == kCameraTerminal;
  Range range;
  uint32_t current = 0;
  const bool is_mode = exposes && selector == kExposureModeControl;
  const bool is_time = exposes && selector == kExposureTimeControl;
  if (is_mode) {
    range = {1, kManual, kAperturePriority, kManual | kAperturePriority, kAperturePriority};
    current = exposure_mode_;
  } else if (is_time) {
    range = ExposureRange(options_);
    current = exposure_;
  } else if (!exposes && selector == kGainControl) {
    range = GainRange(options_);
    current = gain_;
  } else {
    return Refuse(kInvalidControl);
  }
  constexpr uint8_t kGetAndSet = 3, kAutomatic = 4;
  switch (setup.request) {
    case kGetCur:
      return Put(current, range.bytes);
    case kGetMin:
      return Put(range.min, range.bytes);
    case kGetMax:
      return Put(range.max, range.bytes);
    case kGetRes:
      return Put(range.step, range.bytes);
    case kGetDef:
      return Put(range.default_value, range.bytes);
    case kGetLen:
      return Put(static_cast<uint32_t>(range.bytes), 2);
    case kGetInfo:
      return Put(kGetAndSet | (is_time && exposure_mode_ != kManual ? kAutomatic : 0), 1);
    case kSetCur:
      break;
    default:
      return Refuse(kInvalidRequest);
  }
  if (data.size() != range.bytes) return Refuse(kInvalidRequest);
  const uint32_t value = Get(data);
  if (value < range.min || value > range.max) return Refuse(kOutOfRange);
  if (is_mode) {
    if (value != kManual && value != kAperturePriority) return Refuse(kOutOfRange);
    exposure_mode_ = static_cast<uint8_t>(value);
  } else if (is_time) {
    if (exposure_mode_ != kManual) return Refuse(kWrongState);
    exposure_ = value;
  } else {
    gain_ = value;
  }
  return Answer(std::in_place);
}

// Table 4-75 of the Video Class, with the fields that 1.1 added.
std::vector<uint8_t> UvcCamera::Negotiated(uint8_t format) const {
  const auto append = [](std::vector<uint8_t>& to, uint32_t value, size_t bytes) {
    const std::vector<uint8_t> data = Put(value, bytes);
    to.insert(to.end(), data.begin(), data.end());
  };
  std::vector<uint8_t> block;
  append(block, 1, 2);  // the frame's interval is kept
  append(block, format, 1);
  append(block, 1, 1);
  append(block, description_.frame_interval, 4);
  for (int i = 0; i < 4; ++i) append(block, 0, 2);  // nothing is compressed
  append(block, 0, 2);                              // and nothing delayed
  append(block,
         static_cast<uint32_t>(
             UvcFrameBytes(kUvcFormats[format - 1], options_.width, options_.height)),
         4);
  append(block, kUvcPayloadBytes, 4);
  append(block, 48'000'000, 4);
  append(block, 3, 1);  // FID and EOF are used
  append(block, 0, 3);
  return block;
}

UvcCamera::Answer UvcCamera::Negotiate(const UsbSetup& setup, std::span<const uint8_t> data) {
  constexpr size_t kBlockBytes = 34, kFormatAt = 2;
  const uint8_t selector = setup.value >> 8;
  if (selector != kProbeControl && selector != kCommitControl) return Refuse(kInvalidControl);
  const bool probe = selector == kProbeControl;
  switch (setup.request) {
    case kGetCur:
      return Negotiated(probe ? probed_ : committed_);
    case kGetMin:
    case kGetMax:  // of the format that was asked for there is one frame
      return Negotiated(probed_);
    case kGetDef:
      return Negotiated(1);
    case kGetLen:
      return Put(kBlockBytes, 2);
    case kGetInfo:
      return Put(3, 1);
    case kSetCur:
      break;
    default:
      return Refuse(kInvalidRequest);
  }
  if (data.size() != kBlockBytes) return Refuse(kInvalidRequest);
  const uint8_t format = data[kFormatAt];
  const bool known = format >= 1 && format <= kUvcFormats.size();
  // A proposal is answered by what can be had; a decision must be that.
  if (probe) {
    probed_ = known ? format : 1;
  } else if (known) {
    committed_ = format;
  } else {
    return Refuse(kOutOfRange);
  }
  return Answer(std::in_place);
}

}  // namespace lightstage::sim
