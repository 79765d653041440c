#include "client/cli/values.h"

#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "base/status.h"
#include "base/strings.h"

namespace lightstage::client {
namespace {

// More lamps than any brace has: a slip of the finger in a range must not fill the memory.
constexpr int kMostLamps = 100000;

// "7" or "7-9" as first and last lamp.
absl::StatusOr<std::pair<int, int>> ParseRange(const std::string& text) {
  std::vector<std::string> ends = absl::StrSplit(text, absl::MaxSplits('-', 1));
  auto first = ParseInteger(ends.front());
  auto last = ParseInteger(ends.back());
  if (!first.ok() || !last.ok() || *first < 0 || *last < *first) {
    return UsageError(
        absl::StrCat("'", text, "' is no lamp and no range of lamps: give 7 or 7-9, from 0"));
  }
  return std::pair<int, int>(*first, *last);
}

absl::Status CheckCount(size_t count, const std::string& text) {
  if (count <= kMostLamps) return absl::OkStatus();
  return UsageError(absl::StrCat("'", text, "' names more than ", kMostLamps, " lamps"));
}

}  // namespace

absl::Status UsageError(const std::string& message) {
  return Error(absl::StatusCode::kInvalidArgument, "USAGE", message);
}

absl::StatusOr<double> ParseNumber(const std::string& text) {
  double value = 0;
  // SimpleAtod also takes blanks around it, hexadecimal, nan and inf.
  bool decimal = text.find_first_not_of("0123456789+-.eE") == std::string::npos;
  if (!decimal || !absl::SimpleAtod(text, &value) || !std::isfinite(value)) {
    return UsageError(absl::StrCat("'", text, "' is no finite decimal number"));
  }
  return value;
}

absl::StatusOr<double> ParseDuration(const std::string& text) {
  auto value = ParseNumber(text);
  // Longer than a year is a slip, and would not fit the clock's nanoseconds.
  if (!value.ok() || *value < 0 || *value > 3.2e7) {
    return UsageError(absl::StrCat("'", text, "' is no time in seconds from 0 to a year"));
  }
  return value;
}

absl::StatusOr<int> ParseInteger(const std::string& text) {
  int value = 0;
  bool blank = text.find_first_of(" \t\n") != std::string::npos;
  if (blank || !absl::SimpleAtoi(text, &value)) {
    return UsageError(absl::StrCat("'", text, "' is no whole number from ",
                                   std::numeric_limits<int>::min(), " to ",
                                   std::numeric_limits<int>::max()));
  }
  return value;
}

absl::StatusOr<std::vector<double>> ParseNumbers(const std::string& text) {
  std::vector<double> numbers;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(text, ','))) {
    ASSIGN_OR_RETURN(double number, ParseNumber(part));
    numbers.push_back(number);
  }
  return numbers;
}

absl::StatusOr<CountOrAngles> ParseCountOrAngles(const std::string& text) {
  if (text.find_first_of(",.") == std::string::npos) {
    ASSIGN_OR_RETURN(int count, ParseInteger(text));
    return CountOrAngles(count);
  }
  ASSIGN_OR_RETURN(std::vector<double> angles, ParseNumbers(text));
  return CountOrAngles(std::move(angles));
}

absl::StatusOr<std::vector<int>> ParseLamps(const std::string& text) {
  std::vector<int> lamps;
  if (text == "all") return lamps;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(text, ','))) {
    ASSIGN_OR_RETURN(auto range, ParseRange(part));
    RETURN_IF_ERROR(
        CheckCount(lamps.size() + static_cast<size_t>(range.second - range.first) + 1, text));
    for (int lamp = range.first; lamp <= range.second; ++lamp) lamps.push_back(lamp);
  }
  return lamps;
}

absl::StatusOr<std::vector<v1::LampLevel>> ParseLampLevels(const std::string& text) {
  std::vector<v1::LampLevel> levels;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(text, ','))) {
    std::vector<std::string> sides = absl::StrSplit(part, absl::MaxSplits('=', 1));
    if (sides.size() != 2) {
      return UsageError(
          absl::StrCat("'", part, "' sets no lamp: give LAMP=LEVEL, e.g. 3=1.0 or 0-19=0.5"));
    }
    ASSIGN_OR_RETURN(auto range, ParseRange(sides[0]));
    ASSIGN_OR_RETURN(double level, ParseNumber(sides[1]));
    RETURN_IF_ERROR(
        CheckCount(levels.size() + static_cast<size_t>(range.second - range.first) + 1, text));
    for (int lamp = range.first; lamp <= range.second; ++lamp) {
      v1::LampLevel& set = levels.emplace_back();
      set.set_lamp(lamp);
      set.set_level(level);
    }
  }
  return levels;
}

absl::StatusOr<v1::PatternProfile> ParseProfile(const std::string& text) {
  if (text == "box") return v1::PATTERN_PROFILE_BOX;
  if (text == "gaussian") return v1::PATTERN_PROFILE_GAUSSIAN;
  if (text == "hat") return v1::PATTERN_PROFILE_HAT;
  return UsageError(absl::StrCat("'", text, "' is no pattern shape: give box, gaussian or hat"));
}

absl::StatusOr<v1::Pattern> ParsePattern(const std::string& text) {
  static const auto& kPatternFields = *new std::map<std::string, void (v1::Pattern::*)(int)>{
      {"grid", &v1::Pattern::set_grid},
      {"column", &v1::Pattern::set_column},
      {"row", &v1::Pattern::set_row},
      {"influence", &v1::Pattern::set_influence}};
  v1::Pattern pattern;
  pattern.set_profile(v1::PATTERN_PROFILE_BOX);
  pattern.set_grid(16);
  std::vector<std::string> words = absl::StrSplit(text, ',');
  v1::PatternArrangement arrangement = v1::PATTERN_ARRANGEMENT_UNSPECIFIED;
  bool known = v1::PatternArrangement_Parse(
      absl::StrCat("PATTERN_ARRANGEMENT_", absl::AsciiStrToUpper(words[0])), &arrangement);
  if (!known || arrangement == v1::PATTERN_ARRANGEMENT_UNSPECIFIED) {
    return UsageError(absl::StrCat(
        "'", words[0], "' is no pattern: give black, full, square, horizontal or vertical first"));
  }
  pattern.set_arrangement(arrangement);
  if (words.size() > 1 && (arrangement == v1::PATTERN_ARRANGEMENT_FULL ||
                           arrangement == v1::PATTERN_ARRANGEMENT_BLACK)) {
    return UsageError(absl::StrCat("'", words[1], "': ", words[0], " covers the whole picture"));
  }
  std::set<std::string> given;
  for (size_t i = 1; i < words.size(); ++i) {
    std::vector<std::string> sides = absl::StrSplit(words[i], absl::MaxSplits('=', 1));
    if (!given.insert(sides[0]).second) {
      return UsageError(absl::StrCat("'", words[i], "': ", sides[0], " is given twice"));
    }
    if (sides.size() == 2 && sides[0] == "profile") {
      ASSIGN_OR_RETURN(v1::PatternProfile profile, ParseProfile(sides[1]));
      pattern.set_profile(profile);
      continue;
    }
    auto field = kPatternFields.find(sides[0]);
    if (sides.size() == 2 && field != kPatternFields.end()) {
      auto value = ParseInteger(sides[1]);
      if (!value.ok()) return UsageError(absl::StrCat(sides[0], ": ", MessageOf(value.status())));
      (pattern.*field->second)(*value);
      continue;
    }
    return UsageError(absl::StrCat("'", words[i],
                                   "' says nothing about a pattern: give grid=N, column=N, row=N, "
                                   "influence=N or profile=box|gaussian|hat"));
  }
  return pattern;
}

absl::StatusOr<v1::AxisId> ParseAxis(const std::string& text) {
  if (text == "turntable") return v1::AXIS_ID_TURNTABLE;
  if (text == "tilt") return v1::AXIS_ID_TILT;
  return UsageError(absl::StrCat("'", text, "' is no axis: give turntable or tilt"));
}

absl::StatusOr<std::string> ParseRun(const std::string& text) {
  if (text == kLatestRun) return text;
  std::string id(absl::StripPrefix(text, "runs/"));
  bool good = !id.empty();
  for (char c : id) good = good && (absl::ascii_isalnum(c) || c == '-' || c == '_');
  if (!good) {
    return UsageError(
        absl::StrCat("'", text, "' is no run: give its name as runs list shows it, or latest"));
  }
  return absl::StrCat("runs/", id);
}

}  // namespace lightstage::client
