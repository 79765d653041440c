#include "drivers/aravis/link.h"

#include <arv.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "drivers/aravis/glib.h"
#include "drivers/aravis/gvcp_events.h"
#include "drivers/aravis/gvcp_watch.h"

namespace lightstage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kBuffers = 4;  // one exposure at a time; the rest covers late and stray frames
constexpr int kWarmUpFrames = 4;
constexpr gint kSocketBuffer = 32 << 20;

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

AravisLink::AravisLink(const AravisOptions& options, std::string name, Clock& clock, Events events)
    : options_(options), name_(std::move(name)), clock_(clock), events_(std::move(events)) {}

AravisLink::~AravisLink() {
  watch_.reset();
  event_channel_.reset();
  StopStream();
  if (!camera_) return;
  g_clear_object(&chunks_);
  if (lost_handler_ != 0)
    g_signal_handler_disconnect(arv_camera_get_device(camera_), lost_handler_);
  g_object_unref(camera_);
  last_reference_.reset();
}

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

uint64_t AravisLink::next_frame_id() const {
  if (!last_frame_id_) return 0;
  return *last_frame_id_ == 65535 ? 1 : *last_frame_id_ + 1;
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
