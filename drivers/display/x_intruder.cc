#include "drivers/display/x_intruder.h"

#include <X11/Xlib.h>
#include <X11/extensions/Xrandr.h>

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

bool XIntruder::Resize(int width, int height) {
  Window root = DefaultRootWindow(Of(display_));
  XRRModeInfo info{};
  std::string name = std::to_string(width) + "x" + std::to_string(height) + "-test";
  info.width = static_cast<unsigned>(width);
  info.height = static_cast<unsigned>(height);
  info.name = name.data();
  info.nameLength = static_cast<unsigned>(name.size());
  XRRScreenResources* resources = XRRGetScreenResources(Of(display_), root);
  RRMode mode = 0;
  for (int i = 0; i < resources->nmode; ++i) {
    const XRRModeInfo& known = resources->modes[i];
    if (known.width == info.width && known.height == info.height) mode = known.id;
  }
  if (mode == 0) {
    mode = XRRCreateMode(Of(display_), root, &info);
    XRRAddOutputMode(Of(display_), resources->outputs[0], mode);
  }
  const Status set = XRRSetCrtcConfig(Of(display_), resources, resources->crtcs[0], CurrentTime, 0,
                                      0, mode, RR_Rotate_0, resources->outputs, 1);
  XRRFreeScreenResources(resources);
  XSync(Of(display_), False);
  return set == RRSetConfigSuccess;
}

bool XIntruder::SwitchOff() {
  XRRScreenResources* resources =
      XRRGetScreenResources(Of(display_), DefaultRootWindow(Of(display_)));
  const Status set = XRRSetCrtcConfig(Of(display_), resources, resources->crtcs[0], CurrentTime, 0,
                                      0, None, RR_Rotate_0, nullptr, 0);
  XRRFreeScreenResources(resources);
  XSync(Of(display_), False);
  return set == RRSetConfigSuccess;
}

}  // namespace lightstage
