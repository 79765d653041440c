// How a link is opened: found, taken, put into a known state and asked what it can.
#include <arv.h>

#include <algorithm>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "drivers/aravis/glib.h"
#include "drivers/aravis/gvcp_events.h"
#include "drivers/aravis/gvcp_watch.h"
#include "drivers/aravis/link.h"

namespace lightstage {

absl::StatusOr<std::unique_ptr<AravisLink>> AravisLink::Open(const AravisOptions& options,
                                                             const std::string& name, Clock& clock,
                                                             Events events) {
  std::unique_ptr<AravisLink> link(new AravisLink(options, name, clock, std::move(events)));
  RETURN_IF_ERROR(link->Connect());
  RETURN_IF_ERROR(link->Prepare());
  RETURN_IF_ERROR(link->ReadCapabilities());
  RETURN_IF_ERROR(link->PrepareChunks());
  RETURN_IF_ERROR(link->PrepareEvents());
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
  auto lost = +[](ArvDevice*, gpointer self) {
    static_cast<AravisLink*>(self)->events_.lost(
        "control was lost: it was unplugged, restarted or taken by another program");
  };
  lost_handler_ = g_signal_connect(device, "control-lost", G_CALLBACK(lost), this);
  return arv_camera_is_gv_device(camera_) ? WatchGigE() : absl::OkStatus();
}

absl::StatusOr<sockaddr_in> AravisLink::Address() {
  GSocketAddress* of_camera =
      arv_gv_device_get_device_address(ARV_GV_DEVICE(arv_camera_get_device(camera_)));
  sockaddr_in address{};
  GErrorSlot error;
  if (!g_socket_address_to_native(of_camera, &address, sizeof(address), error.out())) {
    return Check(error.get(), "asking for the camera's address");
  }
  address.sin_port = htons(kGvcpPort);
  return address;
}

absl::Status AravisLink::WatchGigE() {
  ASSIGN_OR_RETURN(const sockaddr_in address, Address());
  ASSIGN_OR_RETURN(watch_,
                   GvcpWatch::Start(address, options_.lost_after, [this](const std::string& why) {
                     answers_ = false;
                     events_.lost(why);
                   }));
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

absl::Status AravisLink::WriteRegister(uint32_t address, uint32_t value) {
  GErrorSlot error;
  arv_device_write_register(arv_camera_get_device(camera_), address, value, error.out());
  return Check(error.get(), absl::StrFormat("writing the register %04Xh", address));
}

// A GigE camera that can shall say when its exposures are over.
absl::Status AravisLink::PrepareEvents() {
  constexpr uint32_t kTimeoutMs = 100, kRetries = 3;
  constexpr char kEvent[] = "ExposureEnd";
  if (!options_.exposure_end_event || !arv_camera_is_gv_device(camera_)) return absl::OkStatus();
  const std::vector<std::string> selectors = Choices("EventSelector");
  if (std::find(selectors.begin(), selectors.end(), kEvent) == selectors.end()) {
    return absl::OkStatus();
  }
  GErrorSlot error;
  guint32 channels = 0;
  arv_device_read_register(arv_camera_get_device(camera_), kGvcpMessageChannels, &channels,
                           error.out());
  RETURN_IF_ERROR(Check(error.get(), "reading the number of message channels"));
  if (channels == 0) return absl::OkStatus();
  ASSIGN_OR_RETURN(const sockaddr_in camera, Address());
  // No other event is asked for, but a camera may have been left sending some; SFNC gives the id by this name.
  std::optional<uint16_t> id;
  if (arv_camera_is_feature_available(camera_, "EventExposureEnd", nullptr)) {
    id = static_cast<uint16_t>(arv_camera_get_integer(camera_, "EventExposureEnd", error.out()));
    RETURN_IF_ERROR(Check(error.get(), "reading EventExposureEnd"));
  }
  ASSIGN_OR_RETURN(
      event_channel_,
      GvcpEventChannel::Open(camera, clock_, [this, id](const GvcpEvent& told, TimePoint at) {
        if (reporting_ && (!id.has_value() || told.id == *id)) {
          events_.exposure_ended(told.frame_id, at);
        }
      }));
  const sockaddr_in own = event_channel_->address();
  RETURN_IF_ERROR(WriteRegister(kGvcpMessageAddress, ntohl(own.sin_addr.s_addr)));
  RETURN_IF_ERROR(WriteRegister(kGvcpMessageTimeoutMs, kTimeoutMs));
  RETURN_IF_ERROR(WriteRegister(kGvcpMessageRetries, kRetries));
  RETURN_IF_ERROR(WriteRegister(kGvcpMessagePort, ntohs(own.sin_port)));
  RETURN_IF_ERROR(Choose("EventSelector", kEvent, "exposure_end_event"));
  // SFNC before 1.3 named what turns it on after the transport.
  const std::vector<std::string> switches = Choices("EventNotification");
  const bool old = std::find(switches.begin(), switches.end(), "On") == switches.end();
  return Choose("EventNotification", old ? "GigEVisionEvent" : "On", "exposure_end_event");
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

}  // namespace lightstage
