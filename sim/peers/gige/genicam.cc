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

// Codes of the deep formats: Mono, then Bayer GR, RG, GB, BG.
struct Deep {
  int bits;
  std::string_view packing;
  uint32_t codes[5];
};
constexpr Deep kDeep[] = {
    {16, "", {0x01100007, 0x0110002e, 0x0110002f, 0x01100030, 0x01100031}},
    {12, "", {0x01100005, 0x01100010, 0x01100011, 0x01100012, 0x01100013}},
    {12, "p", {0x010c0047, 0x010c0057, 0x010c0059, 0x010c0055, 0x010c0053}},
    {12, "Packed", {0x010c0006, 0x010c002a, 0x010c002b, 0x010c002c, 0x010c002d}},
    {10, "", {0x01100003, 0x0110000c, 0x0110000d, 0x0110000e, 0x0110000f}},
    {10, "p", {0x010a0046, 0x010a0056, 0x010a0058, 0x010a0054, 0x010a0052}},
    {10, "Packed", {0x010c0004, 0x010c0026, 0x010c0027, 0x010c0028, 0x010c0029}},
};

std::vector<Entry> Formats(int bits, std::string_view packing) {
  std::vector<Entry> formats = {{"Mono8", 0x01080001},    {"BayerGR8", 0x01080008},
                                {"BayerRG8", 0x01080009}, {"BayerGB8", 0x0108000a},
                                {"BayerBG8", 0x0108000b}, {"RGB8", 0x02180014}};
  formats.push_back({absl::StrCat("RGB", bits), bits == 16   ? 0x02300033u
                                                : bits == 12 ? 0x0230001au
                                                             : 0x02300018u});
  for (const Deep& deep : kDeep) {
    if (deep.bits != bits || deep.packing != packing) continue;
    const uint32_t* code = deep.codes;
    for (const char* kind : {"Mono", "BayerGR", "BayerRG", "BayerGB", "BayerBG"}) {
      formats.push_back({absl::StrCat(kind, bits, packing), *code++});
    }
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
  for (const Entry& entry : Formats(options.bits, options.packing)) {
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
