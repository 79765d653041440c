#include "client/cli/progress_line.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "base/strings.h"

namespace lightstage::client {
namespace {

constexpr Duration kBarInterval = std::chrono::milliseconds(100);
constexpr Duration kLineInterval = std::chrono::seconds(5);
// Room for the bar, if the terminal is wide enough: short enough to leave the text whole at 80
// columns.
constexpr int kLongestBar = 30;
constexpr int kShortestBar = 5;

}  // namespace

void ProgressLine::Show(double share, const std::string& text, bool now) {
  TimePoint time = world_.clock.Now();
  Duration interval = world_.err_is_terminal ? kBarInterval : kLineInterval;
  if (shown_ && !now && time - last_ < interval) return;
  shown_ = true;
  last_ = time;
  share = std::isfinite(share) ? std::clamp(share, 0.0, 1.0) : 0.0;
  std::string line = absl::StrFormat("%3d%%  %s", static_cast<int>(share * 100), text);
  if (!world_.err_is_terminal) {
    world_.err << line << std::endl;
    return;
  }
  int columns = std::max(world_.columns - 1, 1);  // the last one would wrap on some terminals
  int bar = std::min(columns - static_cast<int>(line.size()) - 3, kLongestBar);
  if (bar >= kShortestBar) {
    auto full = static_cast<size_t>(std::lround(share * bar));
    line = absl::StrCat("[", std::string(full, '#'),
                        std::string(static_cast<size_t>(bar) - full, '.'), "] ", line);
  }
  line.resize(std::min(line.size(), static_cast<size_t>(columns)));
  // Back to the line's start, the line, erase what is left of the last one.
  world_.err << "\r" << line << "\x1b[K" << std::flush;
  drawn_ = true;
}

void ProgressLine::Clear() {
  if (!drawn_) return;
  world_.err << "\r\x1b[K" << std::flush;
  drawn_ = false;
}

}  // namespace lightstage::client
