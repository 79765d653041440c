#include "drivers/v4l2/discover.h"

#include <linux/videodev2.h>

#include <algorithm>

#include "absl/strings/str_format.h"
#include "drivers/v4l2/capabilities.h"
#include "drivers/v4l2/jpeg.h"

namespace lightstage {
namespace {

std::string SizeNames(const FrameSizes& sizes) {
  if (sizes.discrete.empty()) {
    return absl::StrFormat("up to %dx%d", sizes.width.max, sizes.height.max);
  }
  std::string names;
  for (const auto& [width, height] : sizes.discrete) {
    absl::StrAppend(&names, names.empty() ? "" : " ", width, "x", height);
  }
  return names;
}

// What only the lab knows of the exposure, as a comment.
absl::StatusOr<std::string> ExposureLines(const VideoPort& port) {
  const VideoControls controls(port);
  ASSIGN_OR_RETURN(const auto absolute, controls.Find(V4L2_CID_EXPOSURE_ABSOLUTE));
  ASSIGN_OR_RETURN(const auto units, controls.Find(V4L2_CID_EXPOSURE));
  ASSIGN_OR_RETURN(const auto analogue, controls.Find(V4L2_CID_ANALOGUE_GAIN));
  ASSIGN_OR_RETURN(const auto gain, controls.Find(V4L2_CID_GAIN));
  std::string lines;
  if (absolute) {
    absl::StrAppend(&lines, absl::StrFormat("# exposure: %d to %d us\n", absolute->min * 100,
                                            absolute->max * 100));
  } else if (units) {
    absl::StrAppend(&lines, absl::StrFormat("# exposure: %d to %d units of the camera's own\n"
                                            "# exposure_unit_us = \n",
                                            units->min, units->max));
  } else {
    absl::StrAppend(&lines,
                    "# the exposure can not be set: which one is it?\n"
                    "# fixed_exposure_us = \n");
  }
  if (analogue || gain) absl::StrAppend(&lines, "# gain_db_per_step = \n");
  return lines;
}

absl::StatusOr<std::optional<Discovered>> Look(VideoSystem& system, const std::string& path) {
  ASSIGN_OR_RETURN(const VideoPort port, VideoPort::Open(system, path, "camera"));
  ASSIGN_OR_RETURN(const VideoDescription description, DescribeVideo(port));
  if (!description.captures && !description.multi_planar) return std::optional<Discovered>();
  Discovered found;
  found.what = absl::StrCat(description.card, " (", description.bus_info, ") at ", path, ":");
  if (description.multi_planar) {
    absl::StrAppend(&found.what, " multi-planar only, which this driver does not speak");
    found.toml = "# not usable with driver = \"v4l2\"\n";
    return std::optional<Discovered>(std::move(found));
  }
  for (const auto& format : description.formats) {
    absl::StrAppend(&found.what, " ", FourCcName(format.fourcc), " ", SizeNames(format.sizes), ";");
  }
  const auto usable = UsableFormats(description.formats, V4l2Options());
  if (usable.empty()) {
    const auto& formats = description.formats;
    const bool by_name =
        CanDecodeJpeg() && std::any_of(formats.begin(), formats.end(), [](const auto& format) {
          return format.fourcc == V4L2_PIX_FMT_MJPEG;
        });
    absl::StrAppend(&found.what, " no format that this driver takes",
                    by_name ? " unless it is named" : "");
    found.toml = by_name ? "# lossy and not linear; used only if [camera.options] says so:\n"
                           "# fourcc = \"MJPG\"\n"
                         : "# not usable with driver = \"v4l2\"\n";
    return std::optional<Discovered>(std::move(found));
  }
  ASSIGN_OR_RETURN(const std::string exposure, ExposureLines(port));
  const V4l2Capabilities::Format& best = usable.front();
  found.toml = absl::StrFormat(
      "[camera]\ndriver = \"v4l2\"\nformat = \"%s\"\nwidth = %d\nheight = %d\n"
      "# exposures_us = [ ]\n\n[camera.options]\ncard = %s\nbus_info = %s\n%s",
      PixelFormatName(best.video.format), best.sizes.MaxWidth(), best.sizes.MaxHeight(),
      TomlString(description.card), TomlString(description.bus_info), exposure);
  return std::optional<Discovered>(std::move(found));
}

}  // namespace

std::string TomlString(std::string_view text) {
  std::string out = "\"";
  for (char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte >= 0x7f) {
      // What is not ASCII is taken as Latin-1, so that the result is UTF-8 whatever a camera calls itself.
      absl::StrAppend(&out, absl::StrFormat("\\u%04X", byte));
    } else {
      out += c;
    }
  }
  return out + "\"";
}

absl::StatusOr<std::vector<Discovered>> DiscoverVideo(VideoSystem& system) {
  std::vector<Discovered> all;
  absl::Status trouble;
  bool looked = false;
  for (const std::string& path : system.Paths()) {
    absl::StatusOr<std::optional<Discovered>> found = Look(system, path);
    if (found.ok()) {
      looked = true;
      if (*found) all.push_back(**std::move(found));
      continue;
    }
    trouble = found.status();
    all.push_back({absl::StrCat(path, " could not be looked at: ", MessageOf(trouble)),
                   "# not usable as it is\n"});
  }
  if (!trouble.ok() && !looked) return trouble;
  return all;
}

}  // namespace lightstage
