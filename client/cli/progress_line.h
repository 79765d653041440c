// How far something is: a bar that is redrawn in place on a terminal, a plain line every few
// seconds elsewhere.
#pragma once

#include <string>

#include "base/clock.h"
#include "client/cli/session.h"

namespace lightstage::client {

// On World::err. One thread.
class ProgressLine {
 public:
  explicit ProgressLine(World& world) : world_(world) {}
  // Removes the bar.
  ~ProgressLine() { Clear(); }

  // `share` in [0, 1] is drawn as a bar before `text`, which is cut to the terminal's width. Unless
  // `now`, what comes too soon after the last one is dropped: 0.1 s for a bar, 5 s for lines.
  void Show(double share, const std::string& text, bool now = false);
  // Makes room for another line of text on the terminal.
  void Clear();

 private:
  World& world_;
  bool drawn_ = false;  // a bar is on the terminal
  bool shown_ = false;
  TimePoint last_{};
};

}  // namespace lightstage::client
