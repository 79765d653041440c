#include "drivers/dmx/options.h"

#include <cmath>
#include <map>
#include <string>

#include "absl/strings/str_cat.h"

namespace lightstage::dmx {
namespace {

// "1-2" or "1-2.3.4": a bus and the ports that lead to the device.
bool IsAddress(std::string_view text) {
  bool digit_before = false;
  int dashes = 0;
  for (char c : text) {
    if (c >= '0' && c <= '9') {
      digit_before = true;
      continue;
    }
    if (!digit_before || (c != '-' && c != '.') || (c == '.' && dashes == 0)) return false;
    if (c == '-' && ++dashes > 1) return false;
    digit_before = false;
  }
  return digit_before && dashes == 1;
}

// A list whose elements are whole.
std::vector<int> ParseList(const TomlTable& table) {
  std::vector<int> first;
  for (double channel : table.Doubles("channels", 1, kMaxSlots)) {
    if (channel != std::floor(channel)) {
      table.ErrorAt("channels", absl::StrCat(channel, " is no channel; they are whole numbers"));
      return {};
    }
    first.push_back(static_cast<int>(channel));
  }
  if (first.empty()) table.ErrorAt("channels", "needs at least one channel");
  return first;
}

std::vector<int> ParseRow(const TomlTable& table, int width) {
  const auto from = static_cast<int>(table.Int("first_channel", 1, kMaxSlots));
  const auto count = static_cast<int>(table.Int("lamp_count", 1, kMaxSlots));
  const auto step = static_cast<int>(table.Int("channel_step", 1, kMaxSlots, width));
  std::vector<int> first;
  for (int lamp = 0; lamp < count; ++lamp) first.push_back(from + lamp * step);
  return first;
}

void CheckChannels(const TomlTable& table, const ChannelMap& map, const char* key) {
  std::map<int, size_t> owners;
  for (size_t lamp = 0; lamp < map.first.size(); ++lamp) {
    for (int channel = map.first[lamp]; channel < map.first[lamp] + map.width(); ++channel) {
      if (channel > map.slots) {
        return table.ErrorAt(key, absl::StrCat("lamp ", lamp, " would have channel ", channel,
                                               ", but the universe has ", map.slots,
                                               " (slots; at most ", kMaxSlots, ")"));
      }
      if (auto [other, fresh] = owners.emplace(channel, lamp); !fresh) {
        return table.ErrorAt(key, absl::StrCat("channel ", channel, " is used twice, by lamp ",
                                               other->second, " and lamp ", lamp));
      }
    }
  }
}

}  // namespace

DmxOptions ParseDmxOptions(const TomlTable& table) {
  DmxOptions options;
  const bool pro = table.OneOf("widget", {"open", "pro"}) == "pro";
  options.widget = pro ? WidgetKind::kPro : WidgetKind::kOpen;
  if (table.Has("serial")) options.device.serial = table.String("serial");
  if (table.Has("address")) {
    options.device.address = table.String("address");
    if (!IsAddress(options.device.address)) {
      table.ErrorAt("address",
                    absl::StrCat("\"", options.device.address,
                                 "\" is no place on the USB; must be bus-port[.port …] as "
                                 "in /sys/bus/usb/devices, e.g. \"1-2.3\""));
    }
  }
  if (options.device.serial.empty() && options.device.address.empty()) {
    table.ErrorAt(
        "",
        "needs serial = \"…\" (or address = \"bus-port\" if the widget has none), so that it "
        "can not be another device");
  }

  ChannelMap& map = options.channels;
  map.bits = static_cast<int>(table.Int("bits", 8, 16, 8));
  if (map.bits != 8 && map.bits != 16) {
    table.ErrorAt("bits", absl::StrCat(map.bits, " is neither 8 nor 16"));
    map.bits = 8;
  }
  map.slots = static_cast<int>(table.Int("slots", kMinSlots, kMaxSlots, kMaxSlots));
  if (table.Has("channels")) {
    map.first = ParseList(table);
    CheckChannels(table, map, "channels");
    for (const char* key : {"first_channel", "lamp_count", "channel_step"}) {
      if (!table.Has(key)) continue;
      (void)table.Int(key, 1, kMaxSlots);
      table.ErrorAt(key, "does not go with channels");
    }
  } else if (table.Has("first_channel")) {
    map.first = ParseRow(table, map.width());
    CheckChannels(table, map, "first_channel");
  } else {
    table.ErrorAt("", "needs channels = [ … ], or first_channel and lamp_count");
  }

  options.settle = table.Time("settle_ms", 0, 10000);
  if (table.Has("frame_hz")) {
    options.frame_hz = table.Double("frame_hz", 5, 500);
    const double most = 1 / Seconds(FrameTime(static_cast<size_t>(map.slots)));
    if (pro) {
      table.ErrorAt("frame_hz", "is for widget = \"open\"; a pro has its own rate");
    } else if (options.frame_hz > most) {
      table.ErrorAt("frame_hz",
                    absl::StrCat("a universe of ", map.slots, " slots can be sent at most ",
                                 std::floor(most), " times a second"));
    }
  }
  return options;
}

}  // namespace lightstage::dmx
