#include "drivers/display/screen_wire.h"

#include <charconv>
#include <cmath>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "base/status.h"
#include "base/utf8.h"

namespace lightstage {
namespace {

// One line each.
std::string Line(std::string_view text) {
  std::string line = CutUtf8(text, 1500);
  for (char& c : line) {
    if (c == '\n') c = ' ';
  }
  return line + "\n";
}

absl::Status NoReply(std::string_view text) {
  return Error(absl::StatusCode::kInternal, "SCREEN_REPLY",
               absl::StrCat("the screen process said something that is no reply: \"",
                            CleanUtf8(text.substr(0, 60)), "\""));
}

template <class Number>
std::optional<Number> ParseNumber(std::string_view text) {
  Number value{};
  auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::string EncodeScreenReply(const absl::StatusOr<ScreenInfo>& reply) {
  if (!reply.ok()) {
    return absl::StrCat("error\n", static_cast<int>(reply.status().code()), "\n",
                        Line(ErrorReason(reply.status())), Line(MessageOf(reply.status())));
  }
  return absl::StrCat("ok\n", Line(reply->output), reply->width, "\n", reply->height, "\n",
                      std::lround(reply->refresh_hz * 1000), "\n", Line(reply->renderer),
                      reply->paced ? 1 : 0, "\n", Line(reply->note));
}

absl::StatusOr<ScreenInfo> ParseScreenReply(std::string_view text) {
  std::vector<std::string_view> lines;
  for (std::string_view rest = text; !rest.empty() && lines.size() < 16;) {
    const size_t end = rest.find('\n');
    if (end == std::string_view::npos) return NoReply(text);
    lines.push_back(rest.substr(0, end));
    rest.remove_prefix(end + 1);
  }
  if (lines.size() == 4 && lines[0] == "error") {
    std::optional<int> code = ParseNumber<int>(lines[1]);
    if (!code || *code < 1 || *code > 16) return NoReply(text);
    return Error(static_cast<absl::StatusCode>(*code), lines[2], lines[3]);
  }
  if (lines.size() != 8 || lines[0] != "ok") return NoReply(text);
  std::optional<int> width = ParseNumber<int>(lines[2]), height = ParseNumber<int>(lines[3]);
  std::optional<int> refresh_mhz = ParseNumber<int>(lines[4]);
  if (!width || *width < 1 || !height || *height < 1 || !refresh_mhz || *refresh_mhz < 0 ||
      (lines[6] != "0" && lines[6] != "1")) {
    return NoReply(text);
  }
  ScreenInfo info;
  info.output = lines[1];
  info.width = *width;
  info.height = *height;
  info.refresh_hz = *refresh_mhz / 1000.0;
  info.renderer = lines[5];
  info.paced = lines[6] == "1";
  info.note = lines[7];
  return info;
}

}  // namespace lightstage
