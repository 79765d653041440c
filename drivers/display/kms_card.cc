#include "drivers/display/kms_card.h"

#include <fcntl.h>
#include <unistd.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <optional>
#include <span>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "drivers/display/colour_blobs.h"

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

// An object's property; nothing if it has none of that name.
std::optional<uint64_t> Property(int file, uint32_t object, uint32_t type, std::string_view name) {
  const Owned<drmModeObjectProperties> all(drmModeObjectGetProperties(file, object, type),
                                           drmModeFreeObjectProperties);
  for (uint32_t i = 0; all != nullptr && i < all->count_props; ++i) {
    const Owned<drmModePropertyRes> property(drmModeGetProperty(file, all->props[i]),
                                             drmModeFreeProperty);
    if (property != nullptr && name == property->name) return all->prop_values[i];
  }
  return std::nullopt;
}

bool Asleep(int file, uint32_t connector) {
  return Property(file, connector, DRM_MODE_OBJECT_CONNECTOR, "DPMS").value_or(DRM_MODE_DPMS_ON) !=
         DRM_MODE_DPMS_ON;
}

// The table of drivers that have no properties for it.
std::vector<ColourEntry> LegacyGamma(int file, const drmModeCrtc& crtc) {
  const auto size = static_cast<size_t>(std::max(crtc.gamma_size, 0));
  std::vector<uint16_t> red(size), green(size), blue(size);
  std::vector<ColourEntry> table;
  if (size < 2 || drmModeCrtcGetGamma(file, crtc.crtc_id, static_cast<uint32_t>(size), red.data(),
                                      green.data(), blue.data()) != 0) {
    return table;
  }
  for (size_t i = 0; i < size; ++i) table.push_back({red[i], green[i], blue[i]});
  return table;
}

// The first of what changes codes on their way to the output; nothing if none does.
std::optional<std::string> ChangesCodes(int file, const drmModeCrtc& crtc) {
  bool has_table = false;
  for (const std::string name : {"DEGAMMA_LUT", "CTM", "GAMMA_LUT"}) {
    const std::optional<uint64_t> id = Property(file, crtc.crtc_id, DRM_MODE_OBJECT_CRTC, name);
    has_table |= id.has_value() && name == "GAMMA_LUT";
    if (id.value_or(0) == 0) continue;
    const Owned<drmModePropertyBlobRes> blob(
        drmModeGetPropertyBlob(file, static_cast<uint32_t>(*id)), drmModeFreePropertyBlob);
    if (blob == nullptr) return name;  // is being changed
    const std::span data(static_cast<const std::byte*>(blob->data), blob->length);
    if (!(name == "CTM" ? IsIdentityBlob(data) : IsStraightBlob(data))) return name;
  }
  if (has_table) return std::nullopt;
  const std::vector<ColourEntry> table = LegacyGamma(file, crtc);
  return table.empty() || IsStraight(table) ? std::nullopt : std::optional<std::string>("gamma");
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
  drmDropMaster(file);  // refused if it is none, as it should be
  return std::unique_ptr<KmsCard>(new KmsCard(file, head));
}

KmsCard::KmsCard(int file, const Head& head)
    : file_(file), head_(head), tells_sleep_(!Asleep(file, static_cast<uint32_t>(head.output))) {}

KmsCard::~KmsCard() { close(file_); }

absl::Status KmsCard::Check() const {
  const Owned<drmModeConnector> connector =
      Connector(file_, static_cast<uint32_t>(head_.output), false);
  const auto lost = [&](std::string_view why) {
    return Error(absl::StatusCode::kUnavailable, "DEVICE_LOST",
                 absl::StrCat("output ", head_.name, " ", why), {{"output", head_.name}});
  };
  const Owned<drmModeCrtc> crtc =
      connector != nullptr && connector->connection == DRM_MODE_CONNECTED
          ? CrtcOf(file_, *connector)
          : Owned<drmModeCrtc>(nullptr, drmModeFreeCrtc);
  if (crtc == nullptr || crtc->mode_valid == 0) return lost("was unplugged or switched off");
  // A cable that was out and is back, or one too bad for the mode: the kernel waits for the mode to be set again.
  if (Property(file_, connector->connector_id, DRM_MODE_OBJECT_CONNECTOR, "link-status")
          .value_or(DRM_MODE_LINK_STATUS_GOOD) != DRM_MODE_LINK_STATUS_GOOD) {
    return lost("has lost its link");
  }
  if (tells_sleep_ && Asleep(file_, connector->connector_id)) {
    return lost("was put to sleep (DPMS)");
  }
  if (const auto changes = ChangesCodes(file_, *crtc)) {
    return Error(absl::StatusCode::kFailedPrecondition, "DISPLAY_GAMMA",
                 absl::StrCat("output ", head_.name, ": its ", *changes,
                              " changes the codes of patterns; another program left it set: let "
                              "that take it back, or restart the machine"),
                 {{"output", head_.name}, {"property", *changes}});
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
