#include "drivers/display/x11_server.h"

#include <unistd.h>

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "drivers/display/screen_wire.h"

// clang-format off: Xlib's macros (Status, None, …) must come last, and go at once
#include <X11/Xlib.h>
#include <X11/Xutil.h>
#include <X11/extensions/Xrandr.h>
#include <X11/extensions/dpms.h>
#undef None
#undef Status
// clang-format on

namespace lightstage {
namespace {

// Xlib takes it that the process ends here; this one may.
int DisplayGone(Display*) { _exit(kDisplayGoneExit); }

// Requests that came too late for an output or window are answered by what is then read; nothing to end the process for.
int Ignore(Display*, XErrorEvent*) { return 0; }

// Nothing of a mode that the server does not know.
XRRModeInfo ModeInfo(const XRRScreenResources& resources, RRMode mode) {
  for (int i = 0; i < resources.nmode; ++i) {
    if (resources.modes[i].id == mode) return resources.modes[i];
  }
  return {};
}

double RefreshOf(const XRRModeInfo& info) {
  if (info.hTotal == 0 || info.vTotal == 0) return 0;
  double lines = info.vTotal;
  if (info.modeFlags & RR_DoubleScan) lines *= 2;
  if (info.modeFlags & RR_Interlace) lines /= 2;
  return static_cast<double>(info.dotClock) / (info.hTotal * lines);
}

bool HasProperty(Display* display, RROutput output, const char* name) {
  const Atom atom = XInternAtom(display, name, True);
  int count = 0;
  Atom* all = XRRListOutputProperties(display, output, &count);
  const bool has = atom != 0 && std::find(all, all + count, atom) != all + count;
  if (all != nullptr) XFree(all);
  return has;
}

Scanout ScanoutOf(Display* display, RRCrtc id, const XRRCrtcInfo& crtc, const XRRModeInfo& mode) {
  Scanout scanout;
  scanout.width = static_cast<int>(crtc.width);
  scanout.height = static_cast<int>(crtc.height);
  scanout.mode_width = static_cast<int>(mode.width);
  scanout.mode_height = static_cast<int>(mode.height);
  scanout.rotation = crtc.rotation;
  scanout.transform[0] = scanout.transform[4] = scanout.transform[8] = 1 << 16;
  XRRCrtcTransformAttributes* transform = nullptr;
  if (XRRGetCrtcTransform(display, id, &transform) && transform != nullptr) {
    for (size_t i = 0; i < 9; ++i) {
      scanout.transform[i] = transform->currentTransform.matrix[i / 3][i % 3];
    }
    XFree(transform);
  }
  return scanout;
}

std::string Text(const Head& head) {
  return absl::StrFormat("%dx%d+%d+%d at %.3g Hz by CRTC %d%s%s", head.width, head.height, head.x,
                         head.y, head.refresh_hz, head.crtc, head.altered.empty() ? "" : ", ",
                         head.altered);
}

}  // namespace

absl::StatusOr<std::unique_ptr<X11Server>> X11Server::Connect(const std::string& name) {
  XSetIOErrorHandler(DisplayGone);
  XSetErrorHandler(Ignore);
  Display* display = XOpenDisplay(name.empty() ? nullptr : name.c_str());
  if (display == nullptr) {
    const std::string shown = XDisplayName(name.empty() ? nullptr : name.c_str());
    return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
                 absl::StrCat("there is no X server at \"", shown,
                              "\", or it refuses us (x_display, DISPLAY, XAUTHORITY)"));
  }
  std::unique_ptr<X11Server> server(new X11Server(display));
  int event = 0, error = 0, major = 0, minor = 0;
  if (!XRRQueryExtension(display, &event, &error) || !XRRQueryVersion(display, &major, &minor) ||
      major * 100 + minor < 103) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrCat("the X server ", XDisplayString(display),
                              " has no RandR 1.3, by which outputs are told apart"));
  }
  return server;
}

X11Server::~X11Server() { XCloseDisplay(static_cast<Display*>(display_)); }

std::vector<Head> X11Server::Heads() {
  auto* display = static_cast<Display*>(display_);
  std::vector<Head> heads;
  XRRScreenResources* resources = XRRGetScreenResourcesCurrent(display, DefaultRootWindow(display));
  if (resources == nullptr) return heads;
  for (int i = 0; i < resources->noutput; ++i) {
    XRROutputInfo* output = XRRGetOutputInfo(display, resources, resources->outputs[i]);
    if (output == nullptr) continue;
    XRRCrtcInfo* crtc = output->crtc != 0 && output->connection != RR_Disconnected
                            ? XRRGetCrtcInfo(display, resources, output->crtc)
                            : nullptr;
    if (crtc != nullptr && crtc->mode != 0) {
      Head head;
      head.name.assign(output->name, static_cast<size_t>(output->nameLen));
      head.x = crtc->x;
      head.y = crtc->y;
      head.width = static_cast<int>(crtc->width);
      head.height = static_cast<int>(crtc->height);
      const XRRModeInfo mode = ModeInfo(*resources, crtc->mode);
      head.refresh_hz = RefreshOf(mode);
      head.altered = AlterationOf(ScanoutOf(display, output->crtc, *crtc, mode));
      if (output->npreferred > 0) {
        head.preferred = false;
        for (int k = 0; k < output->npreferred && k < output->nmode; ++k) {
          if (output->modes[k] == crtc->mode) head.preferred = true;
        }
      }
      head.output = resources->outputs[i];
      head.crtc = output->crtc;
      head.mode = crtc->mode;
      heads.push_back(std::move(head));
    }
    if (crtc != nullptr) XRRFreeCrtcInfo(crtc);
    XRRFreeOutputInfo(output);
  }
  XRRFreeScreenResources(resources);
  return heads;
}

std::vector<ColourEntry> X11Server::Gamma(uint64_t crtc) const {
  std::vector<ColourEntry> table;
  XRRCrtcGamma* gamma = XRRGetCrtcGamma(static_cast<Display*>(display_), crtc);
  if (gamma == nullptr) return table;
  for (int i = 0; i < gamma->size; ++i) {
    table.push_back({gamma->red[i], gamma->green[i], gamma->blue[i]});
  }
  XRRFreeGamma(gamma);
  return table;
}

void X11Server::Straighten(const Head& head) {
  const std::vector<ColourEntry> table = Gamma(head.crtc);
  if (table.size() < 2 || IsStraight(table)) return;
  XRRCrtcGamma* gamma = XRRAllocGamma(static_cast<int>(table.size()));
  if (gamma == nullptr) return;
  for (size_t i = 0; i < table.size(); ++i) {
    gamma->red[i] = gamma->green[i] = gamma->blue[i] = StraightEntry(i, table.size());
  }
  XRRSetCrtcGamma(static_cast<Display*>(display_), head.crtc, gamma);
  XRRFreeGamma(gamma);
}

void X11Server::KeepAwake() {
  auto* display = static_cast<Display*>(display_);
  int event = 0, error = 0;
  CARD16 level = DPMSModeOn;
  BOOL enabled = False;
  if (!DPMSQueryExtension(display, &event, &error) || !DPMSCapable(display) ||
      !DPMSInfo(display, &level, &enabled) || !enabled) {
    return;
  }
  DPMSForceLevel(display, DPMSModeOn);
  DPMSDisable(display);
}

absl::Status X11Server::Check(const Head& head) {
  for (const Head& now : Heads()) {
    if (now.output != head.output) continue;
    if (now.width == head.width && now.height == head.height && now.x == head.x &&
        now.y == head.y && now.mode == head.mode && now.crtc == head.crtc && now.altered.empty()) {
      return CheckAwake(head);
    }
    const std::string was = Text(head), is = Text(now);
    return Error(absl::StatusCode::kFailedPrecondition, "DISPLAY_CHANGED",
                 absl::StrCat("output ", head.name, " was changed from ", was, " to ", is),
                 {{"output", head.name}, {"was", was}, {"is", is}});
  }
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
               absl::StrCat("output ", head.name, " was unplugged or switched off"),
               {{"output", head.name}});
}

absl::Status X11Server::CheckUntouched(const Head& head) {
  auto* display = static_cast<Display*>(display_);
  const auto touched = [&](const std::string& what) {
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                 absl::StrCat("output ", head.name, ": ", what), {{"output", head.name}});
  };
  const std::vector<ColourEntry> table = Gamma(head.crtc);
  if (table.size() >= 2 && !IsStraight(table)) {
    return touched(
        "another program has given it a gamma table that changes the codes of patterns (night "
        "light, colour management, xgamma)");
  }
  // Whoever redraws all windows owns this selection (freedesktop.org, Extended Window Manager Hints, _NET_WM_CM_Sn); below Xwayland, which tells
  // of itself by this property, there always is one.
  const std::string selection = absl::StrCat("_NET_WM_CM_S", DefaultScreen(display));
  if (XGetSelectionOwner(display, XInternAtom(display, selection.c_str(), False)) == 0 &&
      !HasProperty(display, head.output, "RANDR Emulation")) {
    return absl::OkStatus();
  }
  return touched(absl::StrCat("on the X server ", XDisplayString(display),
                              " runs a compositor, which draws windows when and as it likes: end "
                              "it, give the projector an X server of its own, or use backend = "
                              "\"kmsdrm\""));
}

absl::Status X11Server::CheckAwake(const Head& head) {
  auto* display = static_cast<Display*>(display_);
  int event = 0, error = 0;
  CARD16 level = DPMSModeOn;
  BOOL enabled = False;
  if (!DPMSQueryExtension(display, &event, &error) || !DPMSInfo(display, &level, &enabled) ||
      !enabled || level == DPMSModeOn) {
    return absl::OkStatus();
  }
  return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
               absl::StrCat("output ", head.name,
                            " was put to sleep (DPMS; xset dpms force on, xset -dpms)"),
               {{"output", head.name}});
}

absl::Status X11Server::CheckPixels(const Head& head, std::span<const uint32_t> pixels) {
  auto* display = static_cast<Display*>(display_);
  XImage* image = XGetImage(display, DefaultRootWindow(display), head.x, head.y,
                            static_cast<unsigned>(head.width), static_cast<unsigned>(head.height),
                            AllPlanes, ZPixmap);
  if (image == nullptr) {
    RETURN_IF_ERROR(Check(head));
    return Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                 absl::StrCat("output ", head.name, ": the X server does not tell what it shows"));
  }
  absl::Status same;
  const bool plain = image->bits_per_pixel == 32 && image->red_mask == 0xff0000 &&
                     image->green_mask == 0xff00 && image->blue_mask == 0xff &&
                     image->byte_order == LSBFirst;
  if (!plain) {
    same = Error(absl::StatusCode::kFailedPrecondition, "DEVICE_UNSUITABLE",
                 absl::StrCat("output ", head.name, ": the X screen has ", image->depth,
                              " bits a pixel; it must have 24, eight a channel"));
  }
  for (int y = 0; same.ok() && y < head.height; ++y) {
    const auto* row = reinterpret_cast<const uint32_t*>(image->data + static_cast<size_t>(y) *
                                                                          image->bytes_per_line);
    for (int x = 0; x < head.width; ++x) {
      const uint32_t want = pixels[static_cast<size_t>(y) * head.width + x], is = row[x] & 0xffffff;
      if (is == want) continue;
      same =
          Error(absl::StatusCode::kFailedPrecondition, "DEVICE_FAULT",
                absl::StrFormat(
                    "output %s shows %06x instead of %06x at pixel (%d, %d): something else is on "
                    "the screen",
                    head.name, is, want, x, y));
      break;
    }
  }
  XDestroyImage(image);
  return same;
}

}  // namespace lightstage
