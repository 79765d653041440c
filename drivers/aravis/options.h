// What a rig file's camera table with driver = "aravis" says, as values.
#pragma once

#include <optional>
#include <string>

#include "base/clock.h"
#include "base/toml.h"

namespace lightstage {

struct AravisOptions {
  std::string address;       // IP address or host name of a GigE camera; empty: found by serial
  std::string serial;        // the camera must have this serial number; empty: any
  std::string pixel_format;  // GenICam's name of the only one to be used; empty: the best
  // GigE only; not given: as the camera stands, and Aravis' own defaults.
  std::optional<int> packet_size;  // bytes, with IP header
  std::optional<Duration>
      packet_timeout;  // without a packet for so long, missing ones are asked for again
  std::optional<Duration> frame_retention;  // without a packet for so long, a frame is given up
  // GigE only: a camera that does not answer for so long is lost.
  Duration lost_after = std::chrono::milliseconds(600);
  bool packet_socket = false;  // raw socket (needs CAP_NET_RAW): cheaper at very high rates
  // How much later than the camera's acknowledgement of a trigger the exposure may start. Not given: an exposure counts as ended
  // only when the first packet of its frame arrives.
  std::optional<Duration> exposure_end_margin;
  std::string trigger_source = "Software";  // or a line's name
  std::string trigger_activation;  // "RisingEdge" or "FallingEdge" of a line; empty: software
  std::string
      exposure_active_line;        // this line puts out when the sensor gathers light; empty: none
  bool chunk_data = true;          // of cameras that have it
  bool exposure_end_event = true;  // of GigE cameras that have it
  double gain_db_per_step =
      0;               // of cameras with a raw gain only; 0: unknown, gain stays at its lowest
  Duration readout{};  // from exposure end until it can expose again; for plans' estimates

  bool SoftwareTriggered() const { return trigger_source == "Software"; }
};

// Reads the camera's table strictly; errors go into the table.
AravisOptions ParseAravisOptions(const TomlTable& table);

}  // namespace lightstage
