#include "drivers/aravis/options.h"

#include "absl/strings/str_cat.h"
#include "drivers/aravis/pixel_formats.h"

namespace lightstage {
namespace {

std::string ParsePixelFormat(const TomlTable& table) {
  if (!table.Has("pixel_format")) return "";
  std::string name = table.String("pixel_format");
  if (!FindGenicamFormat(name)) {
    std::string known;
    for (const GenicamFormat& format : GenicamFormats()) {
      absl::StrAppend(&known, known.empty() ? "" : ", ", format.name);
    }
    table.ErrorAt("pixel_format", absl::StrCat("\"", name, "\" is not known; known: ", known));
  }
  return name;
}

void ParseLines(const TomlTable& table, AravisOptions& options) {
  options.trigger_source = table.String("trigger_source", options.trigger_source);
  if (!options.SoftwareTriggered()) {
    options.trigger_activation =
        table.OneOf("trigger_activation", {"RisingEdge", "FallingEdge"}, "RisingEdge");
    if (options.exposure_end_margin) {
      table.ErrorAt("exposure_end_margin_us",
                    "goes by the acknowledgement of a software trigger: not with trigger_source = "
                    "a line");
    }
  } else if (table.Has("trigger_activation")) {
    table.ErrorAt("trigger_activation", "is a line's: needs trigger_source = \"Line1\" or another");
  }
  options.exposure_active_line = table.String("exposure_active_line", "");
  if (options.exposure_active_line == options.trigger_source) {
    table.ErrorAt("exposure_active_line", absl::StrCat("\"", options.trigger_source,
                                                       "\" is the trigger_source: an output "
                                                       "needs another line"));
  }
}

}  // namespace

AravisOptions ParseAravisOptions(const TomlTable& table) {
  AravisOptions options;
  if (table.Has("address")) options.address = table.String("address");
  if (table.Has("serial")) options.serial = table.String("serial");
  if (options.address.empty() && options.serial.empty()) {
    table.ErrorAt(
        "", "needs address = \"…\" (GigE) or serial = \"…\", so that it can not be another camera");
  }
  options.pixel_format = ParsePixelFormat(table);
  if (table.Has("packet_size")) {
    options.packet_size = static_cast<int>(table.Int("packet_size", 220, 16404));
  }
  if (table.Has("packet_timeout_ms")) {
    options.packet_timeout = table.Time("packet_timeout_ms", 1, 10000);
  }
  if (table.Has("frame_retention_ms")) {
    options.frame_retention = table.Time("frame_retention_ms", 1, 60000);
  }
  options.lost_after = table.Time("lost_after_ms", 100, 60000, 600.0);
  options.packet_socket = table.Bool("packet_socket", false);
  if (table.Has("exposure_end_margin_us")) {
    options.exposure_end_margin = table.Time("exposure_end_margin_us", 0, 1e6);
  }
  ParseLines(table, options);
  options.chunk_data = table.Bool("chunk_data", true);
  options.exposure_end_event = table.Bool("exposure_end_event", true);
  options.gain_db_per_step = table.Double("gain_db_per_step", 0, 10, 0.0);
  options.readout = table.Time("readout_ms", 0, 10000, 0.0);
  return options;
}

}  // namespace lightstage
