#include "sim/scenes/check_mesh_file.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/types/span.h"
#include "base/status.h"

namespace lightstage::sim {

absl::Status WrongMesh(const std::string& path, const std::string& why) {
  return Error(absl::StatusCode::kInvalidArgument, "MESH", absl::StrCat(path, ": ", why),
               {{"file", path}});
}

namespace {

constexpr uint64_t kFewestCorners = 3;  // of a face

// A text line by line.
class Lines {
 public:
  // `number`: of the line before the first.
  Lines(std::string path, std::string_view text, size_t number = 0)
      : path_(std::move(path)), rest_(text), number_(number) {}

  // The next one, without its end; false after the last.
  bool Next() {
    if (rest_.empty()) return false;
    const size_t end = std::min(rest_.find('\n'), rest_.size());
    line_ = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    ++number_;
    return true;
  }
  std::string_view line() const { return line_; }
  size_t number() const { return number_; }
  void CutAt(char comment) { line_ = line_.substr(0, line_.find(comment)); }
  std::vector<std::string> Words() const {
    return absl::StrSplit(absl::string_view(line_.data(), line_.size()), absl::ByAnyChar(" \t\r"),
                          absl::SkipEmpty());
  }
  absl::Status Wrong(const std::string& what) const { return WrongAt(number_, what); }
  absl::Status WrongAt(size_t number, const std::string& what) const {
    return WrongMesh(path_, absl::StrCat("line ", number, ": ", what));
  }

 private:
  const std::string path_;
  std::string_view rest_, line_;
  size_t number_;
};

std::string TooFewCorners(uint64_t corners) {
  return absl::StrCat("the face has ", corners, " corners; must have 3 at least");
}

// The corners of a face in OFF and text PLY.
absl::Status CheckCorners(const Lines& lines, absl::Span<const std::string> corners,
                          uint64_t vertices) {
  if (corners.size() < kFewestCorners) return lines.Wrong(TooFewCorners(corners.size()));
  for (const std::string& corner : corners) {
    uint64_t vertex = 0;
    if (absl::SimpleAtoi(corner, &vertex) && vertex < vertices) continue;
    return lines.Wrong(
        absl::StrCat("the face has the corner ", corner, "; there are ", vertices, " vertices"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckOff(const std::string& path, const std::string& bytes) {
  constexpr size_t kLongestLine = 4000;  // what the importer has room for
  size_t elements = 0;
  uint64_t vertices = 0, faces = 0;
  bool counted = false;
  for (Lines lines(path, bytes); lines.Next();) {
    if (lines.line().size() > kLongestLine) return lines.Wrong("is longer than 4000 characters");
    lines.CutAt('#');
    std::vector<std::string> words = lines.Words();
    if (!words.empty() && !counted && words[0].ends_with("OFF")) words.erase(words.begin());
    if (words.empty()) continue;
    if (!counted) {
      if (words.size() < 2 || !absl::SimpleAtoi(words[0], &vertices) ||
          !absl::SimpleAtoi(words[1], &faces)) {
        return lines.Wrong("must have the numbers of vertices and faces");
      }
      if (vertices > bytes.size() || faces > bytes.size()) {
        return lines.Wrong(absl::StrCat("announces ", vertices, " vertices and ", faces,
                                        " faces, more than the file's ", bytes.size(),
                                        " bytes can hold"));
      }
      counted = true;
      continue;
    }
    if (elements >= vertices + faces) break;  // what else there is, is not read
    if (elements++ < vertices) continue;
    constexpr uint64_t kMostCorners = 9;  // that the importer takes
    uint64_t corners = 0;
    if (!absl::SimpleAtoi(words[0], &corners) || words.size() <= corners) {
      return lines.Wrong("must have a face: how many corners, then each of them");
    }
    if (corners > kMostCorners) {
      return lines.Wrong(absl::StrCat("the face has ", corners, " corners; at most ", kMostCorners,
                                      " can be read from OFF"));
    }
    RETURN_IF_ERROR(CheckCorners(lines, absl::MakeSpan(words).subspan(1, corners), vertices));
  }
  if (!counted || elements < vertices + faces) {
    return WrongMesh(path, absl::StrCat("announces ", vertices, " vertices and ", faces,
                                        " faces, but has only ", elements, " lines for them"));
  }
  return absl::OkStatus();
}

// ---- OBJ

namespace {

// What the corners of faces refer to, by number from 1 or, below 0, from the last one so far.
struct Referred {
  const char* what;
  const char* keyword;
  int64_t count = 0;
  // They may come later in the file.
  int64_t largest = 0;
  size_t largest_line = 0;
};

absl::Status CheckCorner(const Lines& lines, const std::string& corner,
                         std::array<Referred, 3>* kinds) {
  const std::vector<std::string> numbers = absl::StrSplit(corner, '/');
  bool good = numbers.size() <= kinds->size() && !numbers[0].empty();
  for (size_t i = 0; good && i < numbers.size(); ++i) {
    if (numbers[i].empty()) continue;
    Referred& kind = (*kinds)[i];
    int64_t number = 0;
    good = absl::SimpleAtoi(numbers[i], &number) && number != 0;
    if (number < -kind.count) {
      return lines.Wrong(absl::StrCat("the face has the ", kind.what, " ", number, "; there are ",
                                      kind.count, " before it"));
    }
    if (number > kind.largest) kind.largest = number, kind.largest_line = lines.number();
  }
  if (good) return absl::OkStatus();
  return lines.Wrong(
      absl::StrCat("'", corner, "' is no corner of a face, which is e.g. 7, 7/3, 7//5 or 7/3/5"));
}

}  // namespace

absl::StatusOr<uint64_t> CheckObj(const std::string& path, const std::string& bytes) {
  std::array<Referred, 3> kinds = {
      {{"vertex", "v"}, {"texture coordinate", "vt"}, {"normal", "vn"}}};
  Lines lines(path, bytes);
  bool goes_on = false, face = false;  // the line before: in this one; was one
  uint64_t corners = 0, faces = 0;
  while (lines.Next()) {
    std::vector<std::string> words = lines.Words();
    if (!goes_on) {
      face = !words.empty() && words[0] == "f";
      corners = 0;
      faces += face;
      if (face) words.erase(words.begin());
      for (Referred& kind : kinds) kind.count += !words.empty() && words[0] == kind.keyword;
    }
    goes_on = !words.empty() && words.back().ends_with('\\');
    if (!face) continue;
    if (goes_on) words.back().pop_back();
    for (const std::string& corner : words) {
      if (corner.empty()) continue;
      RETURN_IF_ERROR(CheckCorner(lines, corner, &kinds));
      ++corners;
    }
    if (!goes_on && corners < kFewestCorners) return lines.Wrong(TooFewCorners(corners));
  }
  for (const Referred& kind : kinds) {
    if (kind.largest <= kind.count) continue;
    return lines.WrongAt(kind.largest_line, absl::StrCat("the face has the ", kind.what, " ",
                                                         kind.largest, "; there are ", kind.count));
  }
  return faces;
}

// ---- PLY

namespace {

struct Property {
  std::string name;
  size_t count_bytes = 0;  // of a list; 0: it is none
  size_t bytes = 0;        // of a value
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;

  bool IsFaces() const { return name == "face"; }
};

struct PlyHeader {
  std::vector<Element> elements;
  bool text = false, big_endian = false;
  size_t lines = 0, end = 0;  // the body begins behind both

  uint64_t CountOf(const char* name) const {
    uint64_t count = 0;
    for (const Element& element : elements) count += element.name == name ? element.count : 0;
    return count;
  }
};

// 0 if there is no such type.
size_t BytesOf(const std::string& type) {
  static const auto& kBytes = *new absl::flat_hash_map<std::string, size_t>{
      {"char", 1},  {"uchar", 1},   {"int8", 1},   {"uint8", 1},  {"short", 2}, {"ushort", 2},
      {"int16", 2}, {"uint16", 2},  {"int", 4},    {"uint", 4},   {"int32", 4}, {"uint32", 4},
      {"float", 4}, {"float32", 4}, {"double", 8}, {"float64", 8}};
  const auto it = kBytes.find(type);
  return it == kBytes.end() ? 0 : it->second;
}

std::optional<Property> ParseProperty(const std::vector<std::string>& words) {
  Property out{.name = words.back()};
  if (words.size() == 5 && words[1] == "list") {
    out.count_bytes = BytesOf(words[2]);
    out.bytes = BytesOf(words[3]);
    if (out.count_bytes == 0 || out.count_bytes > 4 || words[2].starts_with("float")) return {};
  } else if (words.size() == 3) {
    out.bytes = BytesOf(words[1]);
  }
  if (out.bytes == 0) return {};
  return out;
}

absl::StatusOr<PlyHeader> ParsePlyHeader(const std::string& path, const std::string& bytes) {
  PlyHeader header;
  Lines lines(path, bytes);
  size_t at = 0;
  while (lines.Next()) {
    at += lines.line().size() + 1;
    const std::vector<std::string> words = lines.Words();
    if (lines.number() == 1 && (words.size() != 1 || words[0] != "ply")) break;
    if (words.empty()) continue;
    if (words[0] == "end_header") {
      header.lines = lines.number();
      header.end = std::min(at, bytes.size());
      return header;
    }
    if (words[0] == "format" && words.size() > 1) {
      header.text = words[1] == "ascii";
      header.big_endian = words[1] == "binary_big_endian";
    } else if (words[0] == "element" && words.size() > 2) {
      Element& element = header.elements.emplace_back();
      element.name = words[1];
      if (!absl::SimpleAtoi(words[2], &element.count) || element.count > bytes.size()) {
        return WrongMesh(path, absl::StrCat("announces ", words[2], " of ", words[1], "; its ",
                                            bytes.size(), " bytes cannot hold them"));
      }
    } else if (words[0] == "property") {
      const std::optional<Property> property = ParseProperty(words);
      if (!property.has_value() || header.elements.empty()) {
        return lines.Wrong("is no property of an element, which is e.g. 'property float x'");
      }
      header.elements.back().properties.push_back(*property);
    }
  }
  return WrongMesh(path, "is no PLY file: it must begin with 'ply' and have an 'end_header'");
}

// A line of text with an element in it.
absl::Status CheckPlyLine(const Lines& lines, const Element& element, uint64_t vertices) {
  const std::vector<std::string> words = lines.Words();
  size_t needed = 0;
  for (const Property& property : element.properties) {
    if (property.count_bytes == 0) {
      ++needed;
      continue;
    }
    uint32_t count = 0;
    if (needed >= words.size() || !absl::SimpleAtoi(words[needed], &count)) {
      return lines.Wrong(absl::StrCat("must say how many ", property.name, " there are"));
    }
    const size_t first = needed + 1;
    needed = first + count;
    if (element.IsFaces() && property.name.starts_with("vertex_ind") && needed <= words.size())
      RETURN_IF_ERROR(CheckCorners(lines, absl::MakeSpan(words).subspan(first, count), vertices));
  }
  if (words.size() != needed) {
    return lines.Wrong(
        absl::StrCat("has ", words.size(), " values, must have ", needed, " of a ", element.name));
  }
  for (const std::string& word : words) {
    double value = 0;
    if (!absl::SimpleAtod(word, &value)) {
      return lines.Wrong(absl::StrCat("'", word, "' is no number"));
    }
  }
  return absl::OkStatus();
}

// An element per line; empty lines are passed over, as by the importer.
absl::Status CheckPlyText(const PlyHeader& header, Lines lines) {
  const uint64_t vertices = header.CountOf("vertex");
  auto next = [&lines] {
    while (lines.Next()) {
      if (!lines.line().empty() && lines.line() != "\r") return true;
    }
    return false;
  };
  for (const Element& element : header.elements) {
    for (uint64_t i = 0; i < element.count; ++i) {
      if (!next()) {
        return lines.Wrong(absl::StrCat("truncated: the file ends here with ", i, " of ",
                                        element.count, " of ", element.name));
      }
      RETURN_IF_ERROR(CheckPlyLine(lines, element, vertices));
    }
  }
  while (next()) {
    if (!lines.Words().empty()) return lines.Wrong("there is more than the header announces");
  }
  return absl::OkStatus();
}

absl::Status CheckPlyBinary(const std::string& path, const PlyHeader& header,
                            std::string_view body) {
  // Takes bytes off; false if there are not so many.
  auto skip = [&body](uint64_t bytes) {
    const bool enough = bytes <= body.size();
    body.remove_prefix(enough ? bytes : body.size());
    return enough;
  };
  auto number = [&](size_t bytes) {
    uint64_t value = 0;
    for (size_t k = 0; k < bytes; ++k) {
      const size_t at = header.big_endian ? k : bytes - 1 - k;
      value = value << 8 | static_cast<unsigned char>(body[at]);
    }
    return value;
  };
  for (const Element& element : header.elements) {
    for (uint64_t i = 0; i < element.count; ++i) {
      bool whole = true;
      for (const Property& property : element.properties) {
        uint64_t count = 1;
        if (property.count_bytes > 0 && body.size() >= property.count_bytes) {
          count = number(property.count_bytes);
        }
        whole = whole && skip(property.count_bytes) && skip(count * property.bytes);
        if (whole && element.IsFaces() && property.count_bytes > 0 &&
            property.name.starts_with("vertex_ind") && count < kFewestCorners) {
          return WrongMesh(path, absl::StrCat("face ", i, ": ", TooFewCorners(count)));
        }
      }
      if (!whole) {
        return WrongMesh(path, absl::StrCat("truncated: the file ends in ", element.name, " ", i,
                                            " of ", element.count));
      }
    }
  }
  if (!body.empty()) {
    return WrongMesh(path,
                     absl::StrCat("has ", body.size(), " bytes more than the header announces"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<uint64_t> CheckPly(const std::string& path, const std::string& bytes) {
  ASSIGN_OR_RETURN(const PlyHeader header, ParsePlyHeader(path, bytes));
  const std::string_view body = std::string_view(bytes).substr(header.end);
  RETURN_IF_ERROR(header.text ? CheckPlyText(header, Lines(path, body, header.lines))
                              : CheckPlyBinary(path, header, body));
  return header.CountOf("face");
}

}  // namespace lightstage::sim
