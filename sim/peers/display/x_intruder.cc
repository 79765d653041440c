#include "sim/peers/display/x_intruder.h"

#include <X11/Xlib.h>

namespace lightstage {
namespace {

Display* Of(void* display) { return static_cast<Display*>(display); }

}  // namespace

XIntruder::XIntruder(const std::string& display) : display_(XOpenDisplay(display.c_str())) {}
XIntruder::~XIntruder() { XCloseDisplay(Of(display_)); }

void XIntruder::Cover() {
  XSetWindowAttributes attributes{};
  attributes.override_redirect = True;
  attributes.background_pixel = 0xffffff;
  window_ = XCreateWindow(Of(display_), DefaultRootWindow(Of(display_)), 10, 10, 20, 20, 0,
                          CopyFromParent, InputOutput, nullptr, CWOverrideRedirect | CWBackPixel,
                          &attributes);
  XMapRaised(Of(display_), window_);
  XSync(Of(display_), False);
}

void XIntruder::Raise() {
  XRaiseWindow(Of(display_), window_);
  XSync(Of(display_), False);
}

void XIntruder::Uncover() {
  XDestroyWindow(Of(display_), window_);
  XSync(Of(display_), False);
}

}  // namespace lightstage
