#include "drivers/display/kms_card.h"

#include <fcntl.h>
#include <unistd.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"

namespace lightstage {
namespace {

constexpr int kMostCards = 64;  // as many as the kernel numbers

template <class T>
using Owned = std::unique_ptr<T, void (*)(T*)>;

std::string Path(int card) { return absl::StrCat("/dev/dri/card", card); }

int OpenCard(int card) { return open(Path(card).c_str(), O_RDWR | O_CLOEXEC); }

Owned<drmModeConnector> Connector(int file, uint32_t id, bool look) {
  return {look ? drmModeGetConnector(file, id) : drmModeGetConnectorCurrent(file, id),
          drmModeFreeConnector};
}

// What scans out for it; nothing while it is off.
Owned<drmModeCrtc> CrtcOf(int file, const drmModeConnector& connector) {
  const Owned<drmModeEncoder> encoder(drmModeGetEncoder(file, connector.encoder_id),
                                      drmModeFreeEncoder);
  if (encoder == nullptr) return {nullptr, drmModeFreeCrtc};
  return {drmModeGetCrtc(file, encoder->crtc_id), drmModeFreeCrtc};
}

double RefreshOf(const drmModeModeInfo& mode) {
  if (mode.htotal == 0 || mode.vtotal == 0) return 0;
  double lines = mode.vtotal;
  if ((mode.flags & DRM_MODE_FLAG_DBLSCAN) != 0) lines *= 2;
  if ((mode.flags & DRM_MODE_FLAG_INTERLACE) != 0) lines /= 2;
  if (mode.vscan > 1) lines *= mode.vscan;
  return mode.clock * 1e3 / (mode.htotal * lines);
}

bool IsPreferred(const drmModeModeInfo& mode) { return (mode.type & DRM_MODE_TYPE_PREFERRED) != 0; }

// The mode that SDL leaves it in, or gives it: if it has none of its own list, the one that it prefers, or the largest.
std::optional<drmModeModeInfo> ModeOf(int file, const drmModeConnector& connector) {
  const Owned<drmModeCrtc> crtc = CrtcOf(file, connector);
  std::optional<drmModeModeInfo> best;
  bool preferred = false;
  for (int i = 0; i < connector.count_modes; ++i) {
    const drmModeModeInfo& mode = connector.modes[i];
    if (crtc != nullptr && std::memcmp(&mode, &crtc->mode, sizeof mode) == 0) return mode;
    const bool larger = !best || mode.hdisplay * mode.vdisplay > best->hdisplay * best->vdisplay;
    if (preferred || (!IsPreferred(mode) && !larger)) continue;
    best = mode;
    preferred = IsPreferred(mode);
  }
  return best;
}

void AddHeads(int card, int file, std::vector<Head>* heads) {
  const Owned<drmModeRes> resources(drmModeGetResources(file), drmModeFreeResources);
  if (resources == nullptr) return;  // a card that only computes
  int place = 0;
  for (int i = 0; i < resources->count_connectors; ++i) {
    const Owned<drmModeConnector> connector = Connector(file, resources->connectors[i], true);
    if (connector == nullptr || connector->connection != DRM_MODE_CONNECTED ||
        connector->count_modes == 0) {
      continue;
    }
    const drmModeModeInfo mode = *ModeOf(file, *connector);
    Head head;
    const char* type = drmModeGetConnectorTypeName(connector->connector_type);
    head.name = absl::StrCat(type != nullptr ? type : "Unknown", "-", connector->connector_type_id);
    head.width = mode.hdisplay;
    head.height = mode.vdisplay;
    head.refresh_hz = RefreshOf(mode);
    for (int k = 0; k < connector->count_modes; ++k) {
      if (IsPreferred(connector->modes[k])) head.preferred = IsPreferred(mode);
    }
    head.output = connector->connector_id;
    head.card = card;
    head.place = place++;
    heads->push_back(std::move(head));
  }
}

}  // namespace

absl::StatusOr<std::vector<Head>> KmsCard::Heads() {
  std::vector<Head> heads;
  std::string closed;
  for (int card = 0; card < kMostCards; ++card) {
    const int file = OpenCard(card);
    if (file >= 0) {
      AddHeads(card, file, &heads);
      close(file);
    } else if (errno != ENOENT) {
      absl::StrAppend(&closed, "; ", Path(card), ": ", std::generic_category().message(errno));
    }
  }
  if (!heads.empty()) return heads;
  return Error(absl::StatusCode::kNotFound, "DEVICE_NOT_FOUND",
               absl::StrCat("no card of /dev/dri has an output that is connected", closed));
}

absl::StatusOr<std::unique_ptr<KmsCard>> KmsCard::Open(const Head& head) {
  const int file = OpenCard(head.card);
  if (file < 0) return ErrnoError(errno, "opening", Path(head.card));
  return std::unique_ptr<KmsCard>(new KmsCard(file, head));
}

KmsCard::~KmsCard() { close(file_); }

absl::Status KmsCard::Check() const {
  const Owned<drmModeConnector> connector =
      Connector(file_, static_cast<uint32_t>(head_.output), false);
  const Owned<drmModeCrtc> crtc =
      connector != nullptr && connector->connection == DRM_MODE_CONNECTED
          ? CrtcOf(file_, *connector)
          : Owned<drmModeCrtc>(nullptr, drmModeFreeCrtc);
  if (crtc == nullptr || crtc->mode_valid == 0) {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                 absl::StrCat("output ", head_.name, " was unplugged or switched off"),
                 {{"output", head_.name}});
  }
  const double refresh_hz = RefreshOf(crtc->mode);
  if (crtc->mode.hdisplay == head_.width && crtc->mode.vdisplay == head_.height &&
      refresh_hz == head_.refresh_hz) {
    return absl::OkStatus();
  }
  const std::string was = absl::StrFormat("%dx%d at %.3g Hz", head_.width, head_.height,
                                          head_.refresh_hz),
                    is = absl::StrFormat("%dx%d at %.3g Hz", crtc->mode.hdisplay,
                                         crtc->mode.vdisplay, refresh_hz);
  return Error(absl::StatusCode::kFailedPrecondition, "DISPLAY_CHANGED",
               absl::StrCat("output ", head_.name, " was changed from ", was, " to ", is),
               {{"output", head_.name}, {"was", was}, {"is", is}});
}

uint32_t KmsCard::Picture() const {
  const Owned<drmModeConnector> connector =
      Connector(file_, static_cast<uint32_t>(head_.output), false);
  if (connector == nullptr) return 0;
  const Owned<drmModeCrtc> crtc = CrtcOf(file_, *connector);
  return crtc != nullptr ? crtc->buffer_id : 0;
}

}  // namespace lightstage
