// For tests: another client of the X server, which does what it should not.
#pragma once

#include <string>

namespace lightstage {

class XIntruder {
 public:
  explicit XIntruder(const std::string& display);  // which must be there for as long as this is
  ~XIntruder();
  XIntruder(const XIntruder&) = delete;
  XIntruder& operator=(const XIntruder&) = delete;

  // A white window of 20 x 20 pixels at (10, 10), above all others; above all again; gone.
  void Cover();
  void Raise();
  void Uncover();

 private:
  void* const display_;  // Xlib's Display
  unsigned long window_ = 0;
};

}  // namespace lightstage
