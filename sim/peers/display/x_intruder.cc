#include "sim/peers/display/x_intruder.h"

#include <X11/Xlib.h>
#include <X11/extensions/Xrandr.h>

#include <cmath>

namespace lightstage {
namespace {

Display* Of(void* display) { return static_cast<Display*>(display); }

RRCrtc FirstCrtc(Display* display) {
  XRRScreenResources* resources = XRRGetScreenResourcesCurrent(display, DefaultRootWindow(display));
  const RRCrtc crtc = resources->crtcs[0];
  XRRFreeScreenResources(resources);
  return crtc;
}

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

void XIntruder::PaintRoot() {
  XSetWindowBackground(Of(display_), DefaultRootWindow(Of(display_)), 0xffffff);
  XClearWindow(Of(display_), DefaultRootWindow(Of(display_)));
  XSync(Of(display_), False);
}

void XIntruder::PoseAsCompositor(bool pose) {
  if (window_ == 0) {
    window_ =
        XCreateSimpleWindow(Of(display_), DefaultRootWindow(Of(display_)), 0, 0, 1, 1, 0, 0, 0);
  }
  XSetSelectionOwner(Of(display_), XInternAtom(Of(display_), "_NET_WM_CM_S0", False),
                     pose ? window_ : 0, CurrentTime);
  XSync(Of(display_), False);
}

void XIntruder::SetGamma(double exponent) {
  XRRCrtcGamma* gamma = XRRGetCrtcGamma(Of(display_), FirstCrtc(Of(display_)));
  for (int i = 0; i < gamma->size; ++i) {
    const double x = std::pow(static_cast<double>(i) / (gamma->size - 1), exponent);
    for (auto* table : {gamma->red, gamma->green, gamma->blue}) {
      table[i] = static_cast<unsigned short>(65535 * x);
    }
  }
  XRRSetCrtcGamma(Of(display_), FirstCrtc(Of(display_)), gamma);
  XRRFreeGamma(gamma);
  XSync(Of(display_), False);
}

std::vector<uint16_t> XIntruder::Gamma() {
  XRRCrtcGamma* gamma = XRRGetCrtcGamma(Of(display_), FirstCrtc(Of(display_)));
  std::vector<uint16_t> reds(gamma->red, gamma->red + gamma->size);
  XRRFreeGamma(gamma);
  return reds;
}

}  // namespace lightstage
