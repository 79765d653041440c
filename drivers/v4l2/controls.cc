#include "drivers/v4l2/controls.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "absl/strings/str_format.h"

namespace lightstage {
namespace {

constexpr AutomaticControl kAutomatic[] = {
    {V4L2_CID_EXPOSURE_AUTO, "exposure", V4L2_EXPOSURE_MANUAL},
    {V4L2_CID_EXPOSURE_AUTO_PRIORITY, "dynamic_frame_rate", 0},
    {V4L2_CID_AUTOGAIN, "gain", 0},
    {V4L2_CID_CHROMA_AGC, "gain", 0},
    {V4L2_CID_ISO_SENSITIVITY_AUTO, "gain", V4L2_ISO_SENSITIVITY_MANUAL},
    {V4L2_CID_AUTO_WHITE_BALANCE, "white_balance", 0},
    {V4L2_CID_AUTO_N_PRESET_WHITE_BALANCE, "white_balance", V4L2_WHITE_BALANCE_MANUAL},
    {V4L2_CID_FOCUS_AUTO, "focus", 0},
    {V4L2_CID_BACKLIGHT_COMPENSATION, "backlight", 0},
    {V4L2_CID_POWER_LINE_FREQUENCY, "power_line", V4L2_CID_POWER_LINE_FREQUENCY_DISABLED},
    {V4L2_CID_WIDE_DYNAMIC_RANGE, "wide_dynamic_range", 0},
    {V4L2_CID_AUTOBRIGHTNESS, "brightness", 0},
    {V4L2_CID_HUE_AUTO, "hue", 0},
    {V4L2_CID_IMAGE_STABILIZATION, "stabilization", 0},
    {V4L2_CID_SCENE_MODE, "scene_mode", V4L2_SCENE_MODE_NONE},
};

int SetOrGet(const VideoPort& port, unsigned long request, const ControlRange& control,
             int64_t* value) {
  v4l2_ext_control one = {};
  one.id = control.id;
  if (control.is_64_bit) {
    one.value64 = *value;
  } else {
    one.value = static_cast<int32_t>(*value);
  }
  v4l2_ext_controls all = {};
  all.which = V4L2_CTRL_WHICH_CUR_VAL;
  all.count = 1;
  all.controls = &one;
  const int error = port.Try(request, &all);
  *value = control.is_64_bit ? static_cast<int64_t>(one.value64) : one.value;
  return error;
}

}  // namespace

std::span<const AutomaticControl> AutomaticControls() { return kAutomatic; }

int64_t ControlRange::Fit(int64_t value) const {
  value = std::clamp(value, min, max);
  const int64_t steps = (value - min + step / 2) / step;
  return min + std::min(steps, (max - min) / step) * step;
}

absl::StatusOr<std::optional<ControlRange>> VideoControls::Find(uint32_t id) const {
  v4l2_query_ext_ctrl query = {};
  query.id = id;
  const int error = port_.Try(VIDIOC_QUERY_EXT_CTRL, &query);
  if (error == EINVAL || error == ENOTTY) return std::optional<ControlRange>();
  if (error != 0) return port_.ErrorOf(error, "VIDIOC_QUERY_EXT_CTRL");
  if ((query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) return std::optional<ControlRange>();
  ControlRange control;
  control.id = id;
  control.name.assign(query.name, strnlen(query.name, sizeof query.name));
  // Half of 64 bits, so that differences can not overflow; no real control comes near.
  constexpr int64_t kMost = int64_t{1} << 62;
  control.min = std::clamp<int64_t>(query.minimum, -kMost / 2, kMost / 2);
  control.max = std::clamp<int64_t>(query.maximum, control.min, kMost / 2);
  control.step = static_cast<int64_t>(std::clamp<uint64_t>(query.step, 1, kMost / 2));
  control.default_value = std::clamp<int64_t>(query.default_value, control.min, control.max);
  control.is_64_bit = query.type == V4L2_CTRL_TYPE_INTEGER64;
  control.read_only = (query.flags & V4L2_CTRL_FLAG_READ_ONLY) != 0;
  control.inactive = (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
  return std::optional<ControlRange>(std::move(control));
}

absl::StatusOr<int64_t> VideoControls::Get(const ControlRange& control) const {
  int64_t value = 0;
  const int error = SetOrGet(port_, VIDIOC_G_EXT_CTRLS, control, &value);
  if (error != 0) {
    return port_.ErrorOf(error, absl::StrCat("reading the control '", control.name, "'"));
  }
  return value;
}

absl::Status VideoControls::Set(const ControlRange& control, int64_t value) const {
  int64_t taken = value;
  const int error = SetOrGet(port_, VIDIOC_S_EXT_CTRLS, control, &taken);
  if (error != 0) {
    return port_.ErrorOf(error,
                         absl::StrFormat("setting the control '%s' to %d", control.name, value));
  }
  ASSIGN_OR_RETURN(const int64_t real, Get(control));
  if (real == value) return absl::OkStatus();
  return port_.Refuse("CONTROL_REFUSED", absl::StrFormat("the control '%s' was set to %d and is %d",
                                                         control.name, value, real));
}

absl::Status VideoControls::TurnAutomaticOff(const std::set<std::string>& leave) const {
  for (const AutomaticControl& automatic : kAutomatic) {
    if (leave.count(automatic.name) > 0) continue;
    ASSIGN_OR_RETURN(const std::optional<ControlRange> control, Find(automatic.id));
    if (!control) continue;
    absl::Status off = control->read_only ? absl::OkStatus() : Set(*control, automatic.off);
    if (ErrorReason(off) == "DEVICE_LOST" || ErrorReason(off) == "DEVICE_BUSY") return off;
    // Some refuse to be set and are off all the same.
    ASSIGN_OR_RETURN(const int64_t real, Get(*control));
    // A control that has no effect now need not be off; asked again, for turning others off may change that.
    ASSIGN_OR_RETURN(const std::optional<ControlRange> now, Find(automatic.id));
    if (real == automatic.off || !now || now->inactive) continue;
    return port_.Refuse(
        "CONTROL_AUTOMATIC",
        absl::StrFormat("the control '%s' can not be turned off: it is %d, must be %d (%d to %d "
                        "are possible); leave_automatic = { %s = true } leaves it on",
                        control->name, real, automatic.off, control->min, control->max,
                        automatic.name));
  }
  return absl::OkStatus();
}

}  // namespace lightstage
