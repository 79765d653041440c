#include "drivers/aravis/link.h"

#include <arv.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kBuffers = 4;  // one exposure at a time; the rest covers late and stray frames
constexpr int kWarmUpFrames = 4;
constexpr gint kSocketBuffer = 32 << 20;

// A GError on the stack that becomes a Status.
class GErrorSlot {
 public:
  GErrorSlot() = default;
  GErrorSlot(const GErrorSlot&) = delete;
  GErrorSlot& operator=(const GErrorSlot&) = delete;
  ~GErrorSlot() { g_clear_error(&error_); }
  GError** out() {
    g_clear_error(&error_);
    return &error_;
  }
  const GError* get() const { return error_; }
  std::string message() const { return error_ ? error_->message : "no answer"; }

 private:
  GError* error_ = nullptr;
};

const char* StatusName(ArvBufferStatus status) {
  switch (status) {
    case ARV_BUFFER_STATUS_SUCCESS:
      return "success";
    case ARV_BUFFER_STATUS_CLEARED:
      return "cleared";
    case ARV_BUFFER_STATUS_TIMEOUT:
      return "timeout";
    case ARV_BUFFER_STATUS_MISSING_PACKETS:
      return "missing packets";
    case ARV_BUFFER_STATUS_WRONG_PACKET_ID:
      return "wrong packet id";
    case ARV_BUFFER_STATUS_SIZE_MISMATCH:
      return "size mismatch";
    case ARV_BUFFER_STATUS_FILLING:
      return "still filling";
    case ARV_BUFFER_STATUS_ABORTED:
      return "aborted";
    default:
      return "unknown";
  }
}

Duration Microseconds(double us) { return FromSeconds(us * 1e-6); }

std::string OrEmpty(const char* text) { return text ? text : ""; }

}  // namespace

absl::Status AravisLink::Check(const _GError* error, std::string_view operation) {
  if (!error) {
    answers_ = true;
    return absl::OkStatus();
  }
  absl::StatusCode code = absl::StatusCode::kInternal;
  std::string_view reason = "DEVICE_FAULT";
  if (error->domain == ARV_DEVICE_ERROR) {
    switch (error->code) {
      case ARV_DEVICE_ERROR_TIMEOUT:
        code = absl::StatusCode::kDeadlineExceeded;
        reason = "DEVICE_SILENT";
        answers_ = false;
        break;
      case ARV_DEVICE_ERROR_NOT_CONNECTED:
      case ARV_DEVICE_ERROR_NOT_CONTROLLER:
      case ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED:
        code = absl::StatusCode::kUnavailable;
        reason = "DEVICE_LOST";
        break;
      default:
        break;
    }
  }
  return Error(
      code, reason, absl::StrFormat("%s: %s failed: %s", name_, operation, error->message),
      {{"device", name_}, {"operation", std::string(operation)}, {"detail", error->message}});
}

absl::Status AravisLink::Unsuitable(const std::string& message) const {
  return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
               absl::StrCat(name_, ": ", message), {{"device", name_}});
}

std::vector<std::string> AravisLink::Choices(const char* feature) const {
  guint count = 0;
  const char** names =
      arv_camera_dup_available_enumerations_as_strings(camera_, feature, &count, nullptr);
  std::vector<std::string> choices(names, names + count);
  g_free(names);
  return choices;
}

absl::Status AravisLink::Choose(const char* feature, const std::string& value,
                                std::string_view key) {
  // What can not be changed, as the direction of many lines, may be right already.
  if (OrEmpty(arv_camera_get_string(camera_, feature, nullptr)) == value) return absl::OkStatus();
  const std::vector<std::string> choices = Choices(feature);
  if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
    return Unsuitable(absl::StrFormat(
        "%s needs %s = %s; the camera has %s", key, feature, value,
        choices.empty() ? absl::StrCat("no ", feature) : absl::StrJoin(choices, ", ")));
  }
  GErrorSlot error;
  arv_camera_set_string(camera_, feature, value.c_str(), error.out());
  return Check(error.get(), absl::StrFormat("setting %s to %s", feature, value));
}

std::vector<Discovered> DiscoverAravis() {
  arv_update_device_list();
  std::vector<Discovered> found;
  for (unsigned int i = 0; i < arv_get_n_devices(); ++i) {
    const std::string serial = OrEmpty(arv_get_device_serial_nbr(i)),
                      protocol = OrEmpty(arv_get_device_protocol(i)),
                      address = OrEmpty(arv_get_device_address(i));
    if (protocol == "Fake") continue;  // libaravis' own, within this process
    const bool gige = protocol == "GigEVision";
    Discovered& camera = found.emplace_back();
    camera.what = absl::StrFormat("%s camera %s %s, serial %s, at %s", protocol,
                                  OrEmpty(arv_get_device_vendor(i)),
                                  OrEmpty(arv_get_device_model(i)), serial, address);
    camera.toml = absl::StrFormat(
        "[camera]\ndriver = \"aravis\"\n# format, width, height, exposures_us: as the camera has "
        "them\n"
        "[camera.options]\n%sserial = %s\n",
        gige ? absl::StrFormat("address = %s\n", TomlQuoted(address)) : "", TomlQuoted(serial));
  }
  return found;
}

// The last reference of a device. It has to be given back here: Aravis emits "control-lost" on the device's heartbeat thread, with a
// reference of its own, and the device's end joins that thread.
class AravisLink::LastReference {
 public:
  explicit LastReference(ArvDevice* device) : device_(G_OBJECT(device)) {
    g_object_add_toggle_ref(device_, OnChange, this);
  }
  // Waits for the others, and so for what is just being emitted.
  ~LastReference() {
    {
      MutexLock lock(&mutex_);
      while (!alone_) changed_.Wait(&mutex_);
    }
    g_object_remove_toggle_ref(device_, OnChange, this);
  }
  LastReference(const LastReference&) = delete;
  LastReference& operator=(const LastReference&) = delete;

 private:
  static void OnChange(gpointer self, GObject*, gboolean alone) {
    auto* reference = static_cast<LastReference*>(self);
    MutexLock lock(&reference->mutex_);
    reference->alone_ = alone != FALSE;
    reference->changed_.SignalAll();
  }

  GObject* const device_;
  Mutex mutex_;
  CondVar changed_;
  bool alone_ ABSL_GUARDED_BY(mutex_) = false;
};

AravisLink::AravisLink(const AravisOptions& options, std::string name, Clock& clock, Events events)
    : options_(options), name_(std::move(name)), clock_(clock), events_(std::move(events)) {}

AravisLink::~AravisLink() {
  StopStream();
  if (!camera_) return;
  g_clear_object(&chunks_);
  if (lost_handler_ != 0)
    g_signal_handler_disconnect(arv_camera_get_device(camera_), lost_handler_);
  g_object_unref(camera_);
  last_reference_.reset();
}

absl::StatusOr<std::unique_ptr<AravisLink>> AravisLink::Open(const AravisOptions& options,
                                                             const std::string& name, Clock& clock,
                                                             Events events) {
  std::unique_ptr<AravisLink> link(new AravisLink(options, name, clock, std::move(events)));
  RETURN_IF_ERROR(link->Connect());
  RETURN_IF_ERROR(link->Prepare());
  RETURN_IF_ERROR(link->ReadCapabilities());
  RETURN_IF_ERROR(link->PrepareChunks());
  return link;
}

absl::Status AravisLink::Connect() {
  std::string target = options_.address;
  if (target.empty()) {
    arv_update_device_list();
    std::string seen;
    for (unsigned int i = 0; i < arv_get_n_devices(); ++i) {
      std::string serial = OrEmpty(arv_get_device_serial_nbr(i));
      absl::StrAppend(&seen, seen.empty() ? "" : ", ", serial);
      if (serial == options_.serial) target = OrEmpty(arv_get_device_id(i));
    }
    if (target.empty()) {
      return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
                   absl::StrFormat("%s: no camera with serial '%s' answers; seen: %s", name_,
                                   options_.serial, seen.empty() ? "none" : seen),
                   {{"device", name_}, {"serial", options_.serial}, {"seen", seen}});
    }
  }
  GErrorSlot error;
  camera_ = arv_camera_new(target.c_str(), error.out());
  if (!camera_) {
    return Error(
        absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
        absl::StrFormat("%s: no camera answers at '%s': %s", name_, target, error.message()),
        {{"device", name_}, {"address", target}, {"detail", error.message()}});
  }
  capabilities_.vendor = OrEmpty(arv_camera_get_vendor_name(camera_, nullptr));
  capabilities_.model = OrEmpty(arv_camera_get_model_name(camera_, nullptr));
  capabilities_.serial = OrEmpty(arv_camera_get_device_serial_number(camera_, nullptr));
  // A camera that was found by its serial is the one, even if it gives itself another one than the bus does (USB3 Vision).
  if (!options_.address.empty() && !options_.serial.empty() &&
      capabilities_.serial != options_.serial) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrFormat("%s: the camera at '%s' has serial '%s', the rig file wants '%s'",
                                 name_, target, capabilities_.serial, options_.serial),
                 {{"device", name_},
                  {"address", target},
                  {"serial", capabilities_.serial},
                  {"wanted", options_.serial}});
  }
  ArvDevice* device = arv_camera_get_device(camera_);
  last_reference_ = std::make_unique<LastReference>(device);
  if (arv_camera_is_gv_device(camera_)) {
    arv_camera_gv_set_stream_options(camera_, options_.packet_socket
                                                  ? ARV_GV_STREAM_OPTION_NONE
                                                  : ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    if (options_.packet_size) {
      arv_camera_gv_set_packet_size_adjustment(camera_, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
      arv_camera_gv_set_packet_size(camera_, *options_.packet_size, error.out());
      RETURN_IF_ERROR(Check(error.get(), "setting the packet size"));
    }
    if (!arv_gv_device_is_controller(ARV_GV_DEVICE(device))) {
      return Error(
          absl::StatusCode::kUnavailable, "DEVICE_LOST",
          absl::StrFormat("%s: another program controls the camera at '%s'", name_, target),
          {{"device", name_}, {"address", target}});
    }
  } else if (options_.packet_size || options_.packet_timeout || options_.frame_retention ||
             options_.packet_socket) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrFormat("%s: packet_size, packet_timeout_ms, frame_retention_ms and "
                                 "packet_socket are for GigE cameras; '%s' is none",
                                 name_, target),
                 {{"device", name_}, {"address", target}});
  }
  // The other mode does not say when a frame begins.
  if (arv_camera_is_uv_device(camera_)) arv_camera_uv_set_usb_mode(camera_, ARV_UV_USB_MODE_SYNC);
  auto lost =
      +[](ArvDevice*, gpointer self) { static_cast<AravisLink*>(self)->events_.control_lost(); };
  lost_handler_ = g_signal_connect(device, "control-lost", G_CALLBACK(lost), this);
  return absl::OkStatus();
}

// Whatever state the last user left the camera in.
absl::Status AravisLink::Prepare() {
  GErrorSlot error;
  arv_camera_stop_acquisition(camera_, error.out());
  RETURN_IF_ERROR(Check(error.get(), "stopping the acquisition"));
  if (!arv_camera_is_software_trigger_supported(camera_, nullptr)) {
    return Unsuitable("the camera has no software trigger");
  }
  if (!arv_camera_is_exposure_time_available(camera_, nullptr)) {
    return Unsuitable("the camera's exposure time can not be set");
  }
  if (arv_camera_is_exposure_auto_available(camera_, nullptr)) {
    arv_camera_set_exposure_time_auto(camera_, ARV_AUTO_OFF, error.out());
    RETURN_IF_ERROR(Check(error.get(), "turning automatic exposure off"));
  }
  if (arv_camera_is_gain_auto_available(camera_, nullptr)) {
    arv_camera_set_gain_auto(camera_, ARV_AUTO_OFF, error.out());
    RETURN_IF_ERROR(Check(error.get(), "turning automatic gain off"));
  }
  if (arv_camera_is_binning_available(camera_, nullptr)) {
    arv_camera_set_binning(camera_, 1, 1, error.out());
    RETURN_IF_ERROR(Check(error.get(), "turning binning off"));
  }
  if (arv_camera_is_region_offset_available(camera_, nullptr)) {
    for (const char* offset : {"OffsetX", "OffsetY"}) {
      arv_camera_set_integer(camera_, offset, 0, error.out());
      RETURN_IF_ERROR(Check(error.get(), absl::StrCat("setting ", offset)));
    }
  }
  arv_camera_set_acquisition_mode(camera_, ARV_ACQUISITION_MODE_CONTINUOUS, error.out());
  RETURN_IF_ERROR(Check(error.get(), "setting the acquisition mode"));
  return PrepareLines();
}

// Asks for each of them once, so that a camera that lacks one is refused when it is opened.
absl::Status AravisLink::PrepareLines() {
  if (!options_.SoftwareTriggered()) {
    RETURN_IF_ERROR(TurnTriggerOn());
    RETURN_IF_ERROR(Choose("TriggerSource", options_.trigger_source, "trigger_source"));
  }
  if (options_.exposure_active_line.empty()) return absl::OkStatus();
  constexpr char kKey[] = "exposure_active_line";
  RETURN_IF_ERROR(Choose("LineSelector", options_.exposure_active_line, kKey));
  RETURN_IF_ERROR(Choose("LineMode", "Output", kKey));
  return Choose("LineSource", "ExposureActive", kKey);
}

// Frames shall say how they were exposed. Number and time of a frame are in its leader anyway.
absl::Status AravisLink::PrepareChunks() {
  if (!arv_camera_are_chunks_available(camera_, nullptr)) return absl::OkStatus();
  GErrorSlot error;
  const std::vector<std::string> selectors = Choices("ChunkSelector");
  const auto has = [&](const char* selector, const char* feature) {
    return options_.chunk_data &&
           std::find(selectors.begin(), selectors.end(), selector) != selectors.end() &&
           arv_camera_is_feature_available(camera_, feature, nullptr);
  };
  exposure_chunk_ = has("ExposureTime", "ChunkExposureTime");
  gain_chunk_ =
      capabilities_.gain == AravisCapabilities::Gain::kDecibels && has("Gain", "ChunkGain");
  const bool wanted = exposure_chunk_ || gain_chunk_;
  if (wanted != static_cast<bool>(arv_camera_get_chunk_mode(camera_, nullptr))) {
    arv_camera_set_chunk_mode(camera_, wanted, error.out());
    RETURN_IF_ERROR(Check(error.get(), "setting ChunkModeActive"));
  }
  for (const auto& [selector, on] :
       {std::pair{"ExposureTime", exposure_chunk_}, {"Gain", gain_chunk_}}) {
    if (on) arv_camera_set_chunk_state(camera_, selector, TRUE, error.out());
    RETURN_IF_ERROR(Check(error.get(), absl::StrCat("turning on the chunk ", selector)));
  }
  if (wanted) chunks_ = arv_camera_create_chunk_parser(camera_);
  return absl::OkStatus();
}

// Puts into `frame` what it says of itself.
absl::Status AravisLink::ReadChunks(ArvBuffer* buffer, Frame& frame) {
  GErrorSlot error;
  const auto silent = [&](std::string_view chunk) {
    return Error(absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE",
                 absl::StrFormat("%s: the frame carries no %s: %s; chunk_data = false does without",
                                 name_, chunk, error.message()),
                 {{"device", name_}, {"chunk", std::string(chunk)}});
  };
  if (exposure_chunk_) {
    const double us =
        arv_chunk_parser_get_float_value(chunks_, buffer, "ChunkExposureTime", error.out());
    if (error.get()) return silent("ChunkExposureTime");
    frame.exposure = Microseconds(us);
    if (!capabilities_.SameExposure(used_exposure_, frame.exposure)) {
      return Error(absl::StatusCode::kDataLoss, "FRAME_EXPOSURE",
                   absl::StrFormat("%s: the frame says ChunkExposureTime = %g us, set was %g us",
                                   name_, us, Seconds(used_exposure_) * 1e6),
                   {{"device", name_}, {"exposure_us", absl::StrCat(us)}});
    }
  }
  if (gain_chunk_) {
    const double gain = arv_chunk_parser_get_float_value(chunks_, buffer, "ChunkGain", error.out());
    if (error.get()) return silent("ChunkGain");
    frame.gain_db = gain;
  }
  return absl::OkStatus();
}

absl::Status AravisLink::ReadFormats() {
  GErrorSlot error;
  unsigned int count = 0;
  gint64* codes = arv_camera_dup_available_pixel_formats(camera_, &count, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the pixel formats"));
  std::vector<uint32_t> offered(codes, codes + count);
  g_free(codes);
  capabilities_.formats = UsableFormats(offered, options_.pixel_format);
  if (!capabilities_.formats.empty()) return absl::OkStatus();
  const std::string has = absl::StrJoin(Choices("PixelFormat"), ", ");
  return Unsuitable(options_.pixel_format.empty()
                        ? absl::StrCat("none of the camera's pixel formats can be used: it has ",
                                       has, "; wanted are Mono, Bayer or RGB of 8 to 16 bits")
                        : absl::StrFormat("PixelFormat %s is asked for; the camera has %s",
                                          options_.pixel_format, has));
}

absl::Status AravisLink::ReadCapabilities() {
  RETURN_IF_ERROR(ReadFormats());
  GErrorSlot error;
  AravisCapabilities& caps = capabilities_;

  bool offsets = arv_camera_is_region_offset_available(camera_, nullptr);
  gint low = 0, high = 0;
  arv_camera_get_width_bounds(camera_, &low, &high, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the width's range"));
  caps.width.min = low;
  caps.width.max = high;
  arv_camera_get_height_bounds(camera_, &low, &high, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the height's range"));
  caps.height.min = low;
  caps.height.max = high;
  caps.width.step = std::max(1, arv_camera_get_width_increment(camera_, nullptr));
  caps.height.step = std::max(1, arv_camera_get_height_increment(camera_, nullptr));
  caps.width.has_offset = caps.height.has_offset = offsets;
  if (offsets) {
    caps.width.offset_step = std::max(1, arv_camera_get_x_offset_increment(camera_, nullptr));
    caps.height.offset_step = std::max(1, arv_camera_get_y_offset_increment(camera_, nullptr));
  }

  double shortest = 0, longest = 0;
  arv_camera_get_exposure_time_bounds(camera_, &shortest, &longest, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the exposure time's range"));
  caps.min_exposure = std::max<Duration>(Microseconds(shortest), Duration(1));
  caps.max_exposure = Microseconds(longest);
  for (const char* feature : {"ExposureTime", "ExposureTimeAbs"}) {
    if (!arv_camera_is_feature_available(camera_, feature, nullptr)) continue;
    // Without a step in the camera's description libaravis answers the smallest number there is.
    double step = arv_camera_get_float_increment(camera_, feature, nullptr);
    if (step > 1e-3 && step < longest) caps.exposure_step = Microseconds(step);
  }
  return ReadGain();
}

absl::Status AravisLink::ReadGain() {
  AravisCapabilities& caps = capabilities_;
  if (!arv_camera_is_gain_available(camera_, nullptr)) return absl::OkStatus();
  GErrorSlot error;
  arv_camera_get_gain_bounds(camera_, &caps.min_gain, &caps.max_gain, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the gain's range"));
  bool decibels = arv_camera_is_feature_available(camera_, "Gain", nullptr) ||
                  arv_camera_is_feature_available(camera_, "GainAbs", nullptr);
  caps.gain = decibels ? AravisCapabilities::Gain::kDecibels : AravisCapabilities::Gain::kRaw;
  caps.gain_db_per_step = decibels ? 0 : options_.gain_db_per_step;
  return absl::OkStatus();
}

absl::StatusOr<CameraConfig> AravisLink::Configure(const CameraConfig& config) {
  GErrorSlot error;
  const AravisCapabilities& caps = capabilities_;
  const GenicamFormat* format = caps.Find(config.format);
  arv_camera_set_pixel_format(camera_, format->code, error.out());
  RETURN_IF_ERROR(Check(error.get(), "setting the pixel format"));

  // Offsets go to 0 first: a size is checked against what is left beyond its offset.
  const struct {
    const char *size, *offset;
    const AravisCapabilities::Size& range;
    int value;
  } sides[] = {{"Width", "OffsetX", caps.width, config.width},
               {"Height", "OffsetY", caps.height, config.height}};
  for (const auto& side : sides) {
    if (side.range.has_offset) arv_camera_set_integer(camera_, side.offset, 0, error.out());
    RETURN_IF_ERROR(Check(error.get(), absl::StrCat("setting ", side.offset)));
    arv_camera_set_integer(camera_, side.size, side.value, error.out());
    RETURN_IF_ERROR(Check(error.get(), absl::StrCat("setting ", side.size)));
    if (!side.range.has_offset) continue;
    int offset = CentredOffset(side.range.max, side.value, side.range.offset_step);
    arv_camera_set_integer(camera_, side.offset, offset, error.out());
    RETURN_IF_ERROR(Check(error.get(), absl::StrCat("setting ", side.offset)));
  }

  CameraConfig real = config;
  if (caps.gain != AravisCapabilities::Gain::kNone) {
    bool raw = caps.gain == AravisCapabilities::Gain::kRaw;
    double unit = raw && caps.gain_db_per_step > 0 ? caps.gain_db_per_step : 1;
    double zero = raw ? caps.min_gain : 0;
    double wanted = config.gain_db / unit + zero;
    arv_camera_set_gain(camera_, wanted, error.out());
    RETURN_IF_ERROR(Check(error.get(), "setting the gain"));
    double got = arv_camera_get_gain(camera_, error.out());
    RETURN_IF_ERROR(Check(error.get(), "reading the gain"));
    if (std::abs(got - wanted) > 1e-6) real.gain_db = (got - zero) * unit;
  }

  gint x = 0, y = 0, width = 0, height = 0;
  arv_camera_get_region(camera_, &x, &y, &width, &height, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the region"));
  uint32_t code = arv_camera_get_pixel_format(camera_, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the pixel format"));
  if (code != format->code || width != config.width || height != config.height) {
    return Error(absl::StatusCode::kInternal, "DEVICE_FAULT",
                 absl::StrFormat("%s: asked for %s %dx%d, the camera took format 0x%08x %dx%d",
                                 name_, PixelFormatName(config.format), config.width, config.height,
                                 code, width, height),
                 {{"device", name_}});
  }
  return real;
}

// ---- Stream

void AravisLink::OnStream(void* self, int type) {
  AravisLink* link = static_cast<AravisLink*>(self);
  // session_ is written before the stream's thread starts and after it has ended.
  if (type == ARV_STREAM_CALLBACK_TYPE_START_BUFFER) {
    TimePoint now = link->clock_.Now();
    {
      MutexLock lock(&link->starts_mutex_);
      link->starts_.push_back(now);
    }
    if (link->reporting_) link->events_.first_packet(link->session_, now);
  } else if (type == ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) {
    if (link->reporting_) link->events_.buffer_done(link->session_);
  }
}

// By software also where a line will trigger: the line is listened to only while a frame is asked for.
absl::Status AravisLink::TurnTriggerOn() {
  GErrorSlot error;
  arv_camera_set_trigger(camera_, "Software", error.out());
  RETURN_IF_ERROR(Check(error.get(), "turning the software trigger on"));
  if (options_.SoftwareTriggered()) return absl::OkStatus();
  return Choose("TriggerActivation", options_.trigger_activation, "trigger_activation");
}

absl::Status AravisLink::CreateStream() {
  GErrorSlot error;
  guint payload = arv_camera_get_payload(camera_, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the payload size"));
  auto callback = +[](void* self, ArvStreamCallbackType type, ArvBuffer*) { OnStream(self, type); };
  stream_ = arv_camera_create_stream(camera_, callback, this, error.out());
  if (!stream_) {
    absl::Status why = Check(error.get(), "creating the stream");
    return why.ok() ? Error(absl::StatusCode::kInternal, "DEVICE_FAULT",
                            absl::StrCat(name_, ": can not create a stream"), {{"device", name_}})
                    : why;
  }
  if (ARV_IS_GV_STREAM(stream_)) {
    // A camera sends a frame in one burst. The kernel cuts this down to net.core.rmem_max.
    g_object_set(stream_, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
                 kSocketBuffer, nullptr);
    auto us = [](Duration d) {
      return static_cast<guint>(std::chrono::duration_cast<std::chrono::microseconds>(d).count());
    };
    if (options_.packet_timeout) {
      g_object_set(stream_, "packet-timeout", us(*options_.packet_timeout), nullptr);
    }
    if (options_.frame_retention) {
      g_object_set(stream_, "frame-retention", us(*options_.frame_retention), nullptr);
    }
  }
  for (int i = 0; i < kBuffers; ++i)
    arv_stream_push_buffer(stream_, arv_buffer_new(payload, nullptr));
  return absl::OkStatus();
}

absl::Status AravisLink::StartStream(const CameraConfig& config, TimePoint deadline) {
  StopStream();
  ++session_;
  config_ = config;
  last_frame_id_.reset();
  counts_log_.Restart();
  {
    MutexLock lock(&starts_mutex_);
    starts_.clear();
  }
  RETURN_IF_ERROR(CreateStream());
  RETURN_IF_ERROR(TurnTriggerOn());
  GErrorSlot error;
  arv_camera_start_acquisition(camera_, error.out());
  RETURN_IF_ERROR(Check(error.get(), "starting the acquisition"));
  return WarmUp(deadline);
}

absl::Status AravisLink::WarmUp(TimePoint deadline) {
  Duration exposure =
      std::clamp<Duration>(milliseconds(1), capabilities_.min_exposure, capabilities_.max_exposure);
  RETURN_IF_ERROR(SetExposure(exposure).status());
  auto next = [&]() -> ArvBuffer* {
    Duration patience = std::min<Duration>(seconds(1) + exposure, deadline - clock_.Now());
    auto us = std::chrono::duration_cast<std::chrono::microseconds>(patience).count();
    return arv_stream_timeout_pop_buffer(stream_, std::max<int64_t>(us, 1));
  };
  bool seen = false;
  int outstanding = 0;
  for (int i = 0; i < kWarmUpFrames && clock_.Now() < deadline; ++i) {
    RETURN_IF_ERROR(SoftwareTrigger());
    ++outstanding;
    ArvBuffer* buffer = next();
    if (!buffer) continue;
    --outstanding;
    seen = true;
    if (Take(buffer).frame.ok()) break;
  }
  // A late one must not be taken for the first shot's.
  while (outstanding > 0 && clock_.Now() < deadline) {
    ArvBuffer* buffer = next();
    if (!buffer) break;  // lost, not late
    --outstanding;
    Take(buffer);
  }
  reporting_ = true;
  // A link that always loses packets shows with the first real frame.
  if (seen) return absl::OkStatus();
  return Error(absl::StatusCode::kDeadlineExceeded, "DEVICE_SILENT",
               absl::StrCat(name_, ": no frame came for the first trigger"), {{"device", name_}});
}

void AravisLink::StopStream() {
  reporting_ = false;
  if (!stream_) return;
  if (answers_) arv_camera_stop_acquisition(camera_, nullptr);
  const StreamCounts counts = Counts();
  spdlog::log(counts.AnythingWrong() ? spdlog::level::warn : spdlog::level::info,
              "{}: the stream ends: {}", name_, Text(counts));
  g_clear_object(&stream_);  // joins its thread
}

absl::StatusOr<Duration> AravisLink::SetExposure(Duration exposure) {
  if (asked_exposure_ == exposure) return used_exposure_;
  asked_exposure_.reset();
  GErrorSlot error;
  arv_camera_set_exposure_time(camera_, Seconds(exposure) * 1e6, error.out());
  RETURN_IF_ERROR(Check(error.get(), "setting the exposure time"));
  double us = arv_camera_get_exposure_time(camera_, error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the exposure time"));
  used_exposure_ = Microseconds(us);
  asked_exposure_ = exposure;
  return used_exposure_;
}

absl::Status AravisLink::SoftwareTrigger() {
  GErrorSlot error;
  arv_camera_software_trigger(camera_, error.out());
  return Check(error.get(), "triggering");
}

absl::Status AravisLink::Trigger() {
  if (options_.SoftwareTriggered()) return SoftwareTrigger();
  return Choose("TriggerSource", options_.trigger_source, "trigger_source");
}

absl::Status AravisLink::Triggered() {
  if (options_.SoftwareTriggered()) return absl::OkStatus();
  return Choose("TriggerSource", "Software", "trigger_source");
}

std::optional<AravisLink::Taken> AravisLink::TakeBuffer() {
  if (!stream_) return std::nullopt;
  ArvBuffer* buffer = arv_stream_try_pop_buffer(stream_);
  if (!buffer) return std::nullopt;
  return Take(buffer);
}

StreamCounts AravisLink::Counts() const {
  guint64 completed = 0, failed = 0, underruns = 0, resent = 0, missing = 0, requested = 0;
  arv_stream_get_statistics(stream_, &completed, &failed, &underruns);
  if (ARV_IS_GV_STREAM(stream_)) {
    arv_gv_stream_get_statistics(ARV_GV_STREAM(stream_), &resent, &missing);
    requested = arv_stream_get_info_uint64_by_name(stream_, "n_resend_requests");
  }
  return {completed, failed, underruns, missing, requested, resent};
}

AravisLink::Taken AravisLink::Take(ArvBuffer* buffer) {
  Taken taken{clock_.Now(), ToFrame(buffer)};
  arv_stream_push_buffer(stream_, buffer);
  if (auto lost = counts_log_.Look(Counts(), clock_.Now())) {
    spdlog::warn("{}: the stream loses data: {}", name_, *lost);
  }
  // Frames end in the order in which they began, and each was noted before it was filled.
  MutexLock lock(&starts_mutex_);
  if (!starts_.empty()) {
    taken.first_packet = starts_.front();
    starts_.pop_front();
  }
  return taken;
}

// GigE Vision's 16-bit frame ids run from 1 to 65535; longer ones do not wrap.
uint64_t AravisLink::NextSequence(uint64_t frame_id) {
  uint64_t ahead = 1;
  if (last_frame_id_ && frame_id > *last_frame_id_) {
    ahead = frame_id - *last_frame_id_;
  } else if (last_frame_id_ && *last_frame_id_ <= 65535 && *last_frame_id_ - frame_id > 32767) {
    ahead = frame_id + 65535 - *last_frame_id_;
  }
  last_frame_id_ = frame_id;
  sequence_ += std::max<uint64_t>(ahead, 1);
  return sequence_;
}

absl::StatusOr<Frame> AravisLink::ToFrame(ArvBuffer* buffer) {
  uint64_t id = arv_buffer_get_frame_id(buffer);
  auto incomplete = [&](const std::string& detail) {
    return Error(absl::StatusCode::kDataLoss, "FRAME_INCOMPLETE",
                 absl::StrFormat("%s: frame %d is incomplete: %s", name_, id, detail),
                 {{"device", name_}, {"frame_id", absl::StrCat(id)}, {"detail", detail}});
  };
  ArvBufferStatus status = arv_buffer_get_status(buffer);
  if (status != ARV_BUFFER_STATUS_SUCCESS) return incomplete(StatusName(status));
  ArvBufferPayloadType type = arv_buffer_get_payload_type(buffer);
  if (type != ARV_BUFFER_PAYLOAD_TYPE_IMAGE &&
      type != ARV_BUFFER_PAYLOAD_TYPE_EXTENDED_CHUNK_DATA) {
    return incomplete(absl::StrCat("payload type ", type, " is no image"));
  }
  const GenicamFormat* format = capabilities_.Find(config_.format);
  uint32_t code = arv_buffer_get_image_pixel_format(buffer);
  int width = arv_buffer_get_image_width(buffer), height = arv_buffer_get_image_height(buffer);
  if (code != format->code || width != config_.width || height != config_.height) {
    return incomplete(absl::StrFormat("it is 0x%08x %dx%d instead of 0x%08x %dx%d", code, width,
                                      height, format->code, config_.width, config_.height));
  }
  gint x_padding = 0, y_padding = 0;
  arv_buffer_get_image_padding(buffer, &x_padding, &y_padding);
  const size_t stride = GenicamRowBytes(*format, width) + x_padding;
  size_t size = 0;
  const void* data = arv_buffer_get_image_data(buffer, &size);

  Frame frame;
  frame.format = format->format;
  frame.width = width;
  frame.height = height;
  frame.significant_bits = format->significant_bits;
  frame.exposure = used_exposure_;
  frame.gain_db = config_.gain_db;
  frame.device_timestamp_ns = static_cast<int64_t>(arv_buffer_get_timestamp(buffer));
  frame.sequence = NextSequence(id);
  frame.data = UnpackGenicam(*format, {static_cast<const std::byte*>(data), data ? size : 0}, width,
                             height, stride);
  if (frame.data.empty()) {
    return incomplete(absl::StrFormat("%d bytes of %d", size, stride * height));
  }
  // libaravis does not tell of every transport whether a frame carries any.
  if (arv_buffer_has_chunks(buffer)) RETURN_IF_ERROR(ReadChunks(buffer, frame));
  return frame;
}

}  // namespace lightstage
