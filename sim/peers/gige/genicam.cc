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

std::string Register(std::string_view name, uint32_t address, std::string_view more = "") {
  return absl::StrFormat(
      "<IntReg Name=\"%s\"><Address>0x%x</Address>%s<Length>4</Length><AccessMode>RW</AccessMode>"
      "<pPort>Device</pPort><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>\n",
      name, address, more);
}

std::string Enumeration(std::string_view name, const std::vector<std::string>& values,
                        std::string_view where) {
  std::string xml = absl::StrFormat("<Enumeration Name=\"%s\">", name);
  for (size_t i = 0; i < values.size(); ++i) {
    absl::StrAppendFormat(&xml, "<EnumEntry Name=\"%s\"><Value>%d</Value></EnumEntry>", values[i],
                          i);
  }
  return absl::StrCat(xml, "<pValue>", std::string(where), "</pValue></Enumeration>\n");
}

// Line1, which triggers, and Line2.
std::string Lines() {
  const std::string of_line = "<pIndex Offset=\"0x10\">LineSelectorRegister</pIndex>";
  return absl::StrCat(Enumeration("LineSelector", {"Line1", "Line2"}, "LineSelectorRegister"),
                      Register("LineSelectorRegister", kLineSelectorRegister),
                      Enumeration("LineMode", {"Input", "Output"}, "LineModeRegister"),
                      Register("LineModeRegister", kLineModeRegister, of_line),
                      Enumeration("LineSource", {"Off", "ExposureActive"}, "LineSourceRegister"),
                      Register("LineSourceRegister", kLineSourceRegister, of_line));
}

std::string DoubleChunk(std::string_view name, uint32_t id) {
  return absl::StrFormat(
      "<FloatReg Name=\"%s\"><Address>0</Address><Length>8</Length><AccessMode>RO</AccessMode>"
      "<pPort>%sPort</pPort><Endianess>BigEndian</Endianess></FloatReg>\n"
      "<Port Name=\"%sPort\"><ChunkID>%x</ChunkID></Port>\n",
      name, name, name, id);
}

// Chunks, a gain in dB as they have it, and the stream's destination, which libaravis would else write where the fake camera looks.
std::string Chunks() {
  return absl::StrCat(
      "<Boolean Name=\"ChunkModeActive\"><pValue>ChunkModeRegister</pValue></Boolean>\n",
      Register("ChunkModeRegister", kChunkModeRegister),
      Enumeration("ChunkSelector", {"ExposureTime", "Gain"}, "ChunkSelectorRegister"),
      Register("ChunkSelectorRegister", kChunkSelectorRegister),
      "<Boolean Name=\"ChunkEnable\"><pValue>ChunkEnableRegister</pValue></Boolean>\n",
      Register("ChunkEnableRegister", kChunkEnableRegister,
               "<pIndex Offset=\"0x10\">ChunkSelectorRegister</pIndex>"),
      Register("ChunkExposureRegister", kChunkEnableRegister),
      Register("ChunkGainRegister", kChunkEnableRegister + 0x10),
      DoubleChunk("ChunkExposureTime", kExposureChunk), DoubleChunk("ChunkGain", kGainChunk),
      "<Float Name=\"Gain\"><pValue>GainRaw</pValue><Min>0.0</Min><Max>10.0</Max></Float>\n",
      "<Integer Name=\"ArvGevSCPHostPort\"><pValue>ClientPort</pValue></Integer>\n",
      Register("ClientPort", kClientPortRegister),
      "<Integer Name=\"ArvGevSCDA\"><pValue>ClientAddress</pValue></Integer>\n",
      Register("ClientAddress", kClientAddressRegister), Register("Start", kStartRegister),
      Register("Stop", kStopRegister));
}

std::string Events() {
  return absl::StrCat(
      Enumeration("EventSelector", {"ExposureEnd"}, "EventSelectorRegister"),
      Register("EventSelectorRegister", kEventSelectorRegister),
      Enumeration("EventNotification", {"Off", "On"}, "EventNotificationRegister"),
      Register("EventNotificationRegister", kEventNotificationRegister),
      absl::StrFormat("<Integer Name=\"EventExposureEnd\"><Value>%d</Value></Integer>\n",
                      kExposureEndEvent));
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
  // The fake camera itself knows free running and software only: what the client writes goes elsewhere.
  const size_t source = xml.find("<EnumEntry Name=\"Line0\"");
  const std::string activation = "<EnumEntry Name=\"RisingEdge\" NameSpace=\"Standard\">";
  if (source == std::string::npos || xml.find(activation) == std::string::npos ||
      absl::StrReplaceAll({{"<Address>0x304</Address>",
                            absl::StrFormat("<Address>0x%x</Address>", kTriggerSourceRegister)}},
                          &xml) != 1) {
    return unknown("trigger lines");
  }
  xml.replace(source, std::string_view("<EnumEntry Name=\"Line0\"").size(),
              "<EnumEntry Name=\"Line1\"");
  xml.insert(xml.find(activation),
             "<EnumEntry Name=\"FallingEdge\"><Value>1</Value></EnumEntry>\n");
  xml.insert(xml.find("<!-- Analog control -->"), Lines());
  if (options.exposure_events) xml.insert(xml.find("<!-- Analog control -->"), Events());
  if (options.chunk_data) {
    xml.insert(xml.find("<!-- Analog control -->"), Chunks());
    if (absl::StrReplaceAll({{"<pValue>AcquisitionCommandRegister</pValue>\n\t\t<CommandValue>1<",
                              "<pValue>Start</pValue><CommandValue>1<"},
                             {"<pValue>AcquisitionCommandRegister</pValue>\n\t\t<CommandValue>0<",
                              "<pValue>Stop</pValue><CommandValue>1<"}},
                            &xml) != 2) {
      return unknown("acquisition");
    }
    if (absl::StrReplaceAll(
            {{"<Formula>WIDTH * HEIGHT * ((PIXELFORMAT>>16)&amp;0xFF) / 8</Formula>",
              "<pVariable Name=\"CHUNKS\">ChunkModeRegister</pVariable>"
              "<pVariable Name=\"EXPOSURE\">ChunkExposureRegister</pVariable>"
              "<pVariable Name=\"GAIN\">ChunkGainRegister</pVariable>"
              "<Formula>WIDTH * HEIGHT * ((PIXELFORMAT>>16)&amp;0xFF) / 8 + "
              "CHUNKS * (8 + 16 * EXPOSURE + 16 * GAIN)</Formula>"}},
            &xml) != 1) {
      return unknown("payload size");
    }
  }
  // Regions begin and end on whole Bayer cells.
  if (absl::StrReplaceAll({{"<Inc>1</Inc>", "<Inc>2</Inc>"}}, &xml) != 4 ||
      absl::StrReplaceAll({{"<Min>1</Min>\n\t\t<pMax>", "<Min>2</Min>\n\t\t<pMax>"}}, &xml) != 2) {
    return unknown("steps of the region");
  }
  return xml;
}

}  // namespace lightstage::sim
