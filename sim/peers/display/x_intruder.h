// For tests: another client of the X server, which does what it should not.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

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
  void PaintRoot();  // white
  // Owns the selection that compositors own.
  void PoseAsCompositor(bool pose);
  // The gamma table of the first output's crtc becomes x ^ exponent; all of its reds.
  void SetGamma(double exponent);
  std::vector<uint16_t> Gamma();

 private:
  void* const display_;  // Xlib's Display
  unsigned long window_ = 0;
};

}  // namespace lightstage
