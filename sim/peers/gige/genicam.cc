#include "sim/peers/gige/genicam.h"

#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "base/status.h"

namespace lightstage::sim {
namespace {

struct Entry {
  std::string name;
  uint32_t code;  // GenICam PFNC
};

std::vector<Entry> Formats(int bits) {
  std::vector<Entry> formats = {{"Mono8", 0x01080001},    {"BayerGR8", 0x01080008},
                                {"BayerRG8", 0x01080009}, {"BayerGB8", 0x0108000a},
                                {"BayerBG8", 0x0108000b}, {"RGB8", 0x02180014}};
  uint32_t mono = bits == 16 ? 0x01100007 : bits == 12 ? 0x01100005 : 0x01100003;
  uint32_t bayer = bits == 16 ? 0x0110002e : bits == 12 ? 0x01100010 : 0x0110000c;
  formats.push_back({absl::StrCat("Mono", bits), mono});
  formats.push_back({absl::StrCat("RGB", bits), bits == 16   ? 0x02300033u
                                                : bits == 12 ? 0x0230001au
                                                             : 0x02300018u});
  for (const char* order : {"GR", "RG", "GB", "BG"}) {
    formats.push_back({absl::StrCat("Bayer", order, bits), bayer++});
  }
  return formats;
}

}  // namespace

absl::StatusOr<std::string> AdaptGenicam(std::string xml, const GigeCameraOptions& options) {
  auto unknown = [](std::string_view what) {
    return Error(absl::StatusCode::kInternal, "PEER_XML",
                 absl::StrCat("Aravis' fake camera describes itself in an unknown way: no ",
                              std::string(what)),
                 {{"missing", std::string(what)}});
  };
  size_t format = xml.find("<Enumeration Name=\"PixelFormat\"");
  size_t first = xml.find("<EnumEntry", format);
  size_t last = xml.find("<pValue>PixelFormatRegister", format);
  if (format == std::string::npos || last == std::string::npos || first > last) {
    return unknown("pixel formats");
  }
  std::string entries;
  for (const Entry& entry : Formats(options.bits)) {
    absl::StrAppendFormat(&entries, "<EnumEntry Name=\"%s\"><Value>%d</Value></EnumEntry>\n",
                          entry.name, entry.code);
  }
  xml.replace(first, last - first, entries);

  std::string longest =
      absl::StrFormat("<Max>%.1f</Max>", Seconds(GigeCameraServer::kMaxExposure) * 1e6);
  if (absl::StrReplaceAll({{"<Max>10000000.0</Max>", longest + "<Inc>1.0</Inc>"}}, &xml) != 1) {
    return unknown("longest exposure");
  }
  // Regions begin and end on whole Bayer cells.
  if (absl::StrReplaceAll({{"<Inc>1</Inc>", "<Inc>2</Inc>"}}, &xml) != 4 ||
      absl::StrReplaceAll({{"<Min>1</Min>\n\t\t<pMax>", "<Min>2</Min>\n\t\t<pMax>"}}, &xml) != 2) {
    return unknown("steps of the region");
  }
  return xml;
}

}  // namespace lightstage::sim
