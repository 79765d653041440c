#include <arv.h>

#include "absl/strings/str_format.h"
#include "drivers/aravis/glib.h"
#include "drivers/aravis/link.h"

namespace lightstage {

std::vector<Discovered> DiscoverAravis() {
  arv_update_device_list();
  std::vector<Discovered> found;
  for (unsigned int i = 0; i < arv_get_n_devices(); ++i) {
    const std::string serial = OrEmpty(arv_get_device_serial_nbr(i)),
                      protocol = OrEmpty(arv_get_device_protocol(i)),
                      address = OrEmpty(arv_get_device_address(i));
    if (protocol == "Fake") continue;  // libaravis' own, within this process
    const bool gige = protocol == "GigEVision";
    Discovered& camera = found.emplace_back();
    camera.what = absl::StrFormat("%s camera %s %s, serial %s, at %s", protocol,
                                  OrEmpty(arv_get_device_vendor(i)),
                                  OrEmpty(arv_get_device_model(i)), serial, address);
    camera.toml = absl::StrFormat(
        "[camera]\ndriver = \"aravis\"\n# format, width, height, exposures_us: as the camera has "
        "them\n"
        "[camera.options]\n%sserial = %s\n",
        gige ? absl::StrFormat("address = %s\n", TomlQuoted(address)) : "", TomlQuoted(serial));
  }
  return found;
}

}  // namespace lightstage
