#include "drivers/canopen/eds.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_format.h"
#include "base/status.h"
#include "base/strings.h"

namespace lightstage::canopen {
namespace {

// A data sheet of a big drive has some 10 000 lines.
constexpr size_t kMostBytes = size_t{4} << 20;

struct Value {
  std::string text;
  int line = 0;
};

struct Section {
  int line = 0;
  std::map<std::string, Value> values;  // by key in lower case

  const Value* Find(const char* key) const {
    auto at = values.find(key);
    return at == values.end() || at->second.text.empty() ? nullptr : &at->second;
  }
};

std::string_view Trim(std::string_view text) {
  while (!text.empty() && absl::ascii_isspace(static_cast<unsigned char>(text.front()))) {
    text.remove_prefix(1);
  }
  while (!text.empty() && absl::ascii_isspace(static_cast<unsigned char>(text.back()))) {
    text.remove_suffix(1);
  }
  return text;
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  absl::AsciiStrToLower(&lower);
  return lower;
}

absl::Status At(const std::string& file, int line, std::string_view what) {
  return Error(absl::StatusCode::kInvalidArgument, "EDS_INVALID",
               absl::StrCat(file, ":", line, ": ", what),
               {{"file", file}, {"line", absl::StrCat(line)}});
}

// The sections by name in lower case.
absl::StatusOr<std::map<std::string, Section>> ReadSections(std::string_view text,
                                                            const std::string& file) {
  std::map<std::string, Section> sections;
  Section* section = nullptr;
  int number = 0;
  while (!text.empty()) {
    ++number;
    const size_t end = text.find('\n');
    const std::string_view line = Trim(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.front() == ';') continue;
    if (line.front() == '[') {
      if (line.back() != ']' || line.size() < 3) return At(file, number, "is no [section]");
      auto [at, added] = sections.try_emplace(Lower(Trim(line.substr(1, line.size() - 2))));
      section = &at->second;
      if (!added) {
        return At(file, number,
                  absl::StrCat("section ", line, " is given twice, first in line ", section->line));
      }
      section->line = number;
      continue;
    }
    const size_t equals = line.find('=');
    if (equals == 0 || equals == std::string_view::npos) {
      return At(file, number, "is neither [section], key=value nor ; comment");
    }
    if (section == nullptr) return At(file, number, "stands before the first [section]");
    const std::string key = Lower(Trim(line.substr(0, equals)));
    auto [at, added] =
        section->values.try_emplace(key, Value{std::string(Trim(line.substr(equals + 1))), number});
    if (!added) {
      return At(file, number,
                absl::StrCat(key, " is given twice, first in line ", at->second.line));
    }
  }
  return sections;
}

// Decimal, 0x… hexadecimal or 0… octal (CiA 306-1, 4.3), with a sign.
std::optional<int64_t> ParseNumber(std::string_view text) {
  text = Trim(text);
  const bool negative = !text.empty() && text.front() == '-';
  if (negative) text.remove_prefix(1);
  int base = 10;
  if (text.size() > 2 && text[0] == '0' && (text[1] == 'x' || text[1] == 'X')) {
    base = 16;
    text.remove_prefix(2);
  } else if (text.size() > 1 && text[0] == '0') {
    base = 8;
    text.remove_prefix(1);
  }
  int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) return std::nullopt;
  return negative ? -value : value;
}

// A number or "$NODEID + number" in either order.
std::optional<int64_t> ParseValue(std::string_view text, int node) {
  std::string lower = Lower(text);
  const size_t variable = lower.find("$nodeid");
  if (variable == std::string::npos) return ParseNumber(lower);
  lower.erase(variable, 7);
  std::string_view rest = Trim(lower);
  if (rest.empty()) return node;
  if (rest.front() == '+') {
    rest.remove_prefix(1);
  } else if (rest.back() == '+') {
    rest.remove_suffix(1);
  } else {
    return std::nullopt;
  }
  const std::optional<int64_t> offset = ParseNumber(rest);
  if (!offset.has_value() || *offset > UINT32_MAX) return std::nullopt;
  return *offset + node;
}

// Bits of the integer types; 0: none.
int IntegerBits(uint16_t type) {
  switch (type) {
    case 0x02:
    case 0x05:
      return 8;
    case 0x03:
    case 0x06:
      return 16;
    case 0x04:
    case 0x07:
      return 32;
    default:
      return 0;
  }
}

// Makers give limits of signed objects as bit patterns as well: 0x80000000 is the lowest of 32 bits.
int64_t AsSigned(int64_t value, uint16_t type) {
  const int bits = IntegerBits(type);
  const bool is_signed = type >= 0x02 && type <= 0x04;
  if (!is_signed || value < int64_t{1} << (bits - 1) || value >= int64_t{1} << bits) return value;
  return value - (int64_t{1} << bits);
}

bool IsHex(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(),
                                      [](unsigned char c) { return std::isxdigit(c) != 0; });
}

// "6064" and "1018sub1"; nothing for other sections.
std::optional<ObjectAddress> ParseSectionName(std::string_view name) {
  const size_t sub_at = name.find("sub");
  const std::string_view index = name.substr(0, sub_at);
  if (index.size() != 4 || !IsHex(index)) return std::nullopt;
  ObjectAddress object;
  std::from_chars(index.data(), index.data() + 4, object.index, 16);
  if (sub_at == std::string_view::npos) return object;
  const std::string_view sub = name.substr(sub_at + 3);
  if (!IsHex(sub) || sub.size() > 2) return std::nullopt;
  std::from_chars(sub.data(), sub.data() + sub.size(), object.sub, 16);
  return object;
}

class ObjectReader {
 public:
  ObjectReader(const std::string& file, int node) : file_(file), node_(node) {}

  absl::StatusOr<std::optional<int64_t>> Number(const Section& section, const char* key) {
    const Value* value = section.Find(key);
    if (value == nullptr) return std::optional<int64_t>();
    const std::optional<int64_t> number = ParseValue(value->text, node_);
    if (!number.has_value()) {
      return At(file_, value->line, absl::StrCat(key, " = ", value->text, " is no number"));
    }
    return number;
  }

  absl::StatusOr<EdsObject> Object(const Section& section) {
    EdsObject object;
    if (const Value* name = section.Find("parametername")) object.name = name->text;
    ASSIGN_OR_RETURN(const std::optional<int64_t> type, Number(section, "datatype"));
    if (type.has_value()) {
      if (*type < 0 || *type > 0xFFFF) {
        return At(file_, section.Find("datatype")->line, "datatype is not from 0 to FFFFh");
      }
      object.type = static_cast<uint16_t>(*type);
    }
    if (const Value* access = section.Find("accesstype")) {
      const std::string kind = Lower(access->text);
      if (kind != "ro" && kind != "wo" && kind != "rw" && kind != "rwr" && kind != "rww" &&
          kind != "const") {
        return At(
            file_, access->line,
            absl::StrCat("accesstype = ", access->text, ", must be ro, wo, rw, rwr, rww or const"));
      }
      object.writable = kind != "ro" && kind != "const";
    }
    if (IntegerBits(object.type) == 0) return object;  // strings have a default value as well
    const std::pair<const char*, std::optional<int64_t>*> limits[] = {
        {"lowlimit", &object.low}, {"highlimit", &object.high}, {"defaultvalue", &object.standard}};
    for (const auto& [key, limit] : limits) {
      ASSIGN_OR_RETURN(*limit, Number(section, key));
      if (limit->has_value()) *limit = AsSigned(**limit, object.type);
    }
    if (object.low.has_value() && object.high.has_value() && *object.low > *object.high) {
      return At(file_, section.line,
                absl::StrFormat("lowlimit %d is above highlimit %d", *object.low, *object.high));
    }
    return object;
  }

 private:
  const std::string& file_;
  const int node_;
};

}  // namespace

absl::StatusOr<Eds> Eds::Parse(std::string_view text, const std::string& file, int node) {
  if (text.size() > kMostBytes) {
    return At(file, 1, absl::StrCat("is longer than ", kMostBytes >> 20, " MB"));
  }
  ASSIGN_OR_RETURN(const auto sections, ReadSections(text, file));
  const auto info = sections.find("deviceinfo");
  if (info == sections.end()) return At(file, 1, "has no [DeviceInfo]: it is no EDS");
  Eds eds;
  eds.file_ = file;
  ObjectReader reader(file, node);
  const std::pair<const char*, std::optional<uint32_t>*> numbers[] = {
      {"vendornumber", &eds.vendor_}, {"productnumber", &eds.product_}};
  for (const auto& [key, number] : numbers) {
    ASSIGN_OR_RETURN(const std::optional<int64_t> value, reader.Number(info->second, key));
    if (value.has_value() && (*value < 0 || *value > UINT32_MAX)) {
      return At(file, info->second.Find(key)->line, absl::StrCat(key, " has more than 32 bits"));
    }
    if (value.has_value() && *value != 0) *number = static_cast<uint32_t>(*value);
  }
  for (const auto& [name, section] : sections) {
    const std::optional<ObjectAddress> address = ParseSectionName(name);
    if (!address.has_value()) continue;
    ASSIGN_OR_RETURN(EdsObject object, reader.Object(section));
    // All sub-objects of such an array are alike, and have no sections.
    ASSIGN_OR_RETURN(const std::optional<int64_t> compact, reader.Number(section, "compactsubobj"));
    for (int64_t sub = 1; sub <= std::min<int64_t>(compact.value_or(0), 254); ++sub) {
      eds.objects_[{address->index, static_cast<uint8_t>(sub)}] = object;
    }
    // An array or record itself has no access type; its parts have.
    eds.objects_[*address] = std::move(object);
  }
  if (eds.objects_.empty()) return At(file, 1, "has no objects: it is no EDS");
  return eds;
}

const EdsObject* Eds::Find(ObjectAddress object) const {
  auto at = objects_.find(object);
  return at == objects_.end() ? nullptr : &at->second;
}

absl::Status Eds::CheckWrite(ObjectAddress object, int64_t value) const {
  const ErrorMetadata metadata = {
      {"object", ObjectText(object)}, {"value", absl::StrCat(value)}, {"eds", file_}};
  const EdsObject* known = Find(object);
  if (known == nullptr) {
    return Error(absl::StatusCode::kNotFound, "OBJECT_MISSING",
                 absl::StrCat(ObjectText(object), " is not in ", file_), metadata);
  }
  const std::string what = absl::StrCat(ObjectText(object), " (", known->name, ")");
  if (!known->writable) {
    return Error(absl::StatusCode::kFailedPrecondition, "OBJECT_READ_ONLY",
                 absl::StrCat(what, " can not be written, says ", file_), metadata);
  }
  if ((known->low.has_value() && value < *known->low) ||
      (known->high.has_value() && value > *known->high)) {
    const std::string low = known->low.has_value() ? absl::StrCat(*known->low) : "its lowest";
    const std::string high = known->high.has_value() ? absl::StrCat(*known->high) : "its highest";
    return Error(
        absl::StatusCode::kOutOfRange, "OBJECT_LIMIT",
        absl::StrCat(what, " can not be ", value, ": ", file_, " says from ", low, " to ", high),
        metadata);
  }
  return absl::OkStatus();
}

}  // namespace lightstage::canopen
