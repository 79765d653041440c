#include "base/toml.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <deque>
#include <map>
#include <set>
#include <sstream>
#include <tuple>

#include "absl/strings/ascii.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "base/status.h"
#include "toml++/toml.h"

namespace lightstage {
namespace {

constexpr size_t kMostErrors = 10;
constexpr size_t kDeepestKey = 100;

const toml::table& AsTable(const void* node) { return *static_cast<const toml::table*>(node); }

const char* TypeName(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return "an array";
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
      return "an integer";
    case toml::node_type::floating_point:
      return "a number";
    case toml::node_type::boolean:
      return "true or false";
    default:
      return "a date or time";
  }
}

std::optional<double> AsNumber(const toml::node& node) {
  if (const auto* integer = node.as_integer()) return static_cast<double>(integer->get());
  if (const auto* floating = node.as_floating_point()) return floating->get();
  return std::nullopt;
}

std::string RangeText(double lo, double hi) {
  return absl::StrCat("must be from ", lo, " to ", hi);
}

// Levenshtein's distance.
size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

// The line, from 1, of the first dotted key with more than kDeepestKey parts, 0 if there is none: every part is a table in a table, and
// the parser puts no limit to how deep they go. Right as far as `text` is TOML; the parser goes no further.
size_t LineOfTooDeepKey(std::string_view text) {
  size_t line = 1, dots = 0;
  std::string_view quote;  // ends the string that the text is in
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\n') ++line;
    if (!quote.empty()) {
      if (c == '\\' && quote[0] == '"') {
        if (++i < text.size() && text[i] == '\n') ++line;
      } else if (text.substr(i).starts_with(quote)) {
        i += quote.size() - 1;
        // Before the three that end it, a string over several lines may have two more.
        for (int more = 0; more < 2 && quote.size() == 3; ++more) {
          if (text.substr(i + 1).starts_with(quote[0])) ++i;
        }
        quote = {};
      }
    } else if (c == '"' || c == '\'') {
      const bool three = text.substr(i, 3) == std::string(3, c);
      quote = text.substr(i, three ? 3 : 1);
      i += quote.size() - 1;
    } else if (c == '#') {
      i = std::min(text.find('\n', i), text.size()) - 1;
    } else if (c == '.') {
      if (++dots >= kDeepestKey) return line;
    } else if (std::string_view("\n=,[]{}").find(c) != std::string_view::npos) {
      dots = 0;
    }
  }
  return 0;
}

// What the writer of an unknown key may have meant.
std::string Suggestion(std::string_view key, const std::set<std::string>& known) {
  std::string best;
  size_t best_distance = std::max<size_t>(2, key.size() / 3) + 1;
  for (const std::string& candidate : known) {
    size_t distance = EditDistance(key, candidate);
    // "exposure" for "exposure_us" is far by edits, yet what people write.
    if (candidate.find(key) != std::string::npos || key.find(candidate) != std::string::npos) {
      distance = std::min<size_t>(distance, 2);
    }
    if (distance < best_distance) best_distance = distance, best = candidate;
  }
  if (!best.empty()) return absl::StrCat("unknown key; did you mean '", best, "'?");
  if (known.empty()) return "unknown key; this table takes none";
  return absl::StrCat("unknown key; known here: ", absl::StrJoin(known, ", "));
}

}  // namespace

struct TomlTable::Impl {
  // Where a table that is not in the file would have been.
  struct Missing {
    toml::source_position at;
    bool reported;  // its absence is an error already: its keys' absence is not another
  };

  std::string filename;
  toml::table root;
  std::deque<toml::table> missing_tables;
  std::map<const toml::table*, Missing> missing;
  std::map<const toml::table*, std::set<std::string>> known;  // keys asked for
  std::map<const toml::table*, std::set<std::string>> used;   // keys read or complained about
  std::set<const toml::table*> ignored;
  std::vector<std::tuple<toml::source_index, toml::source_index, std::string>> errors;

  toml::source_position PositionOf(const toml::table& table, std::string_view key) const {
    for (const auto& [name, node] : table) {
      if (!key.empty() && name.str() == key) return name.source().begin;
    }
    auto it = missing.find(&table);
    toml::source_position at = it != missing.end() ? it->second.at : table.source().begin;
    return at ? at : toml::source_position{1, 1};
  }

  std::string Where(toml::source_position at) const {
    return absl::StrCat(filename, ":", at.line, ":", at.column);
  }

  void Record(const toml::table& table, const std::string& path, std::string_view key,
              std::string_view message) {
    auto it = missing.find(&table);
    if (it != missing.end() && it->second.reported) return;
    toml::source_position at = PositionOf(table, key);
    std::string text = absl::StrCat(Where(at), ": ");
    if (!path.empty()) absl::StrAppend(&text, "[", path, "]", key.empty() ? "" : " ");
    absl::StrAppend(&text, key, path.empty() && key.empty() ? "" : ": ", message);
    errors.emplace_back(at.line, at.column, std::move(text));
  }

  // The node at `key`, noted as known and used; null if there is none.
  const toml::node* Take(const toml::table& table, std::string_view key) {
    known[&table].insert(std::string(key));
    const toml::node* node = table.get(key);
    if (node != nullptr) used[&table].insert(std::string(key));
    return node;
  }

  // A key that nobody read.
  struct Unknown {
    toml::source_position at;
    const toml::table* table;
    std::string path, key;
  };

  // All of them below `table`.
  void FindUnknown(const toml::table& table, const std::string& path, std::vector<Unknown>* out) {
    if (ignored.count(&table) != 0) return;
    const std::set<std::string>& read = used[&table];
    for (const auto& [name, node] : table) {
      std::string key(name.str());
      if (read.count(key) == 0) {
        out->push_back({name.source().begin, &table, path, std::move(key)});
        continue;
      }
      std::string below = path.empty() ? key : absl::StrCat(path, ".", key);
      if (const toml::table* sub = node.as_table(); sub != nullptr) {
        FindUnknown(*sub, below, out);
      } else if (const toml::array* array = node.as_array(); array != nullptr) {
        for (size_t i = 0; i < array->size(); ++i) {
          if (const toml::table* element = (*array)[i].as_table()) {
            FindUnknown(*element, absl::StrCat(below, "[", i, "]"), out);
          }
        }
      }
    }
  }

  // Records the first ones in the file, as many as can be shown: finding what was meant takes its time. Returns how many are left.
  size_t RecordUnknown() {
    std::vector<Unknown> unknown;
    FindUnknown(root, "", &unknown);
    const size_t shown = std::min(unknown.size(), kMostErrors);
    std::partial_sort(unknown.begin(), unknown.begin() + static_cast<ptrdiff_t>(shown),
                      unknown.end(), [](const Unknown& a, const Unknown& b) {
                        return std::tie(a.at.line, a.at.column) < std::tie(b.at.line, b.at.column);
                      });
    for (size_t i = 0; i < shown; ++i) {
      const Unknown& u = unknown[i];
      Record(*u.table, u.path, u.key, Suggestion(u.key, known[u.table]));
    }
    return unknown.size() - shown;
  }
};

TomlTable::TomlTable(std::shared_ptr<Impl> impl, const void* node, std::string path)
    : impl_(std::move(impl)), node_(node), path_(std::move(path)) {}

double TomlTable::Double(std::string_view key, double lo, double hi,
                         std::optional<double> fallback) const {
  const toml::node* node = impl_->Take(AsTable(node_), key);
  if (node == nullptr) {
    if (!fallback) ErrorAt(key, absl::StrCat("missing; a number, ", RangeText(lo, hi)));
    return fallback.value_or(lo);
  }
  std::optional<double> value = AsNumber(*node);
  if (!value) {
    ErrorAt(key, absl::StrCat("is ", TypeName(*node), ", must be a number from ", lo, " to ", hi));
  } else if (!std::isfinite(*value) || *value < lo || *value > hi) {
    ErrorAt(key, absl::StrCat("is ", *value, ", ", RangeText(lo, hi)));
  } else {
    return *value;
  }
  return fallback.value_or(lo);
}

int64_t TomlTable::Int(std::string_view key, int64_t lo, int64_t hi,
                       std::optional<int64_t> fallback) const {
  const toml::node* node = impl_->Take(AsTable(node_), key);
  std::string range = absl::StrCat("an integer from ", lo, " to ", hi);
  if (node == nullptr) {
    if (!fallback) ErrorAt(key, absl::StrCat("missing; ", range));
  } else if (const auto* value = node->as_integer(); value == nullptr) {
    ErrorAt(key, absl::StrCat("is ", TypeName(*node), ", must be ", range));
  } else if (value->get() < lo || value->get() > hi) {
    ErrorAt(key, absl::StrCat("is ", value->get(), ", must be ", range));
  } else {
    return value->get();
  }
  return fallback.value_or(lo);
}

bool TomlTable::Bool(std::string_view key, std::optional<bool> fallback) const {
  const toml::node* node = impl_->Take(AsTable(node_), key);
  if (node == nullptr) {
    if (!fallback) ErrorAt(key, "missing; true or false");
  } else if (const auto* value = node->as_boolean()) {
    return value->get();
  } else {
    ErrorAt(key, absl::StrCat("is ", TypeName(*node), ", must be true or false"));
  }
  return fallback.value_or(false);
}

std::string TomlTable::String(std::string_view key, std::optional<std::string> fallback) const {
  const toml::node* node = impl_->Take(AsTable(node_), key);
  if (node == nullptr) {
    if (!fallback) ErrorAt(key, "missing; a string");
  } else if (const auto* value = node->as_string()) {
    return value->get();
  } else {
    ErrorAt(key, absl::StrCat("is ", TypeName(*node), ", must be a string"));
  }
  return std::move(fallback).value_or("");
}

std::string TomlTable::OneOf(std::string_view key, const std::vector<std::string>& choices,
                             std::optional<std::string> fallback) const {
  assert(!choices.empty());
  const toml::node* node = impl_->Take(AsTable(node_), key);
  std::string one_of = absl::StrCat("one of \"", absl::StrJoin(choices, "\", \""), "\"");
  if (node == nullptr) {
    if (!fallback) ErrorAt(key, absl::StrCat("missing; ", one_of));
  } else if (const auto* value = node->as_string(); value == nullptr) {
    ErrorAt(key, absl::StrCat("is ", TypeName(*node), ", must be ", one_of));
  } else if (std::find(choices.begin(), choices.end(), value->get()) == choices.end()) {
    ErrorAt(key, absl::StrCat("is \"", value->get(), "\", must be ", one_of));
  } else {
    return value->get();
  }
  return std::move(fallback).value_or(choices.front());
}

Duration TomlTable::Time(std::string_view key, double lo, double hi,
                         std::optional<double> fallback) const {
  double nanoseconds = key.ends_with("_us") ? 1e3 : key.ends_with("_ms") ? 1e6 : 1e9;
  assert(nanoseconds < 1e9 || key.ends_with("_s"));
  return Duration(std::llround(Double(key, lo, hi, fallback) * nanoseconds));
}

std::vector<double> TomlTable::Doubles(std::string_view key, double lo, double hi, int count,
                                       std::optional<std::vector<double>> fallback) const {
  const toml::node* node = impl_->Take(AsTable(node_), key);
  std::string want =
      count < 0 ? "an array of numbers" : absl::StrCat("an array of ", count, " numbers");
  // What parsing code may index without looking while errors are pending.
  const bool needed = !fallback.has_value();
  std::vector<double> filler = std::move(fallback).value_or(
      std::vector<double>(static_cast<size_t>(std::max(count, 0)), lo));
  if (node == nullptr) {
    if (needed) ErrorAt(key, absl::StrCat("missing; ", want));
    return filler;
  }
  const toml::array* array = node->as_array();
  if (array == nullptr) {
    ErrorAt(key, absl::StrCat("is ", TypeName(*node), ", must be ", want));
    return filler;
  }
  if (count >= 0 && array->size() != static_cast<size_t>(count)) {
    ErrorAt(key, absl::StrCat("has ", array->size(), " elements, must be ", want));
    return filler;
  }
  std::vector<double> values;
  for (size_t i = 0; i < array->size(); ++i) {
    std::optional<double> value = AsNumber((*array)[i]);
    if (!value) {
      ErrorAt(key,
              absl::StrCat("element ", i, " is ", TypeName((*array)[i]), ", must be a number"));
      return filler;
    }
    if (!std::isfinite(*value) || *value < lo || *value > hi) {
      ErrorAt(key, absl::StrCat("element ", i, " is ", *value, ", ", RangeText(lo, hi)));
      return filler;
    }
    values.push_back(*value);
  }
  return values;
}

bool TomlTable::Has(std::string_view key) const {
  impl_->known[&AsTable(node_)].insert(std::string(key));
  return AsTable(node_).get(key) != nullptr;
}

TomlTable TomlTable::Table(std::string_view key, bool required) const {
  const toml::table& self = AsTable(node_);
  const toml::node* node = impl_->Take(self, key);
  std::string path = path_.empty() ? std::string(key) : absl::StrCat(path_, ".", key);
  if (node != nullptr && node->is_table()) return TomlTable(impl_, node->as_table(), path);
  auto it = impl_->missing.find(&self);
  bool reported = it != impl_->missing.end() && it->second.reported;
  if (node != nullptr) {
    ErrorAt(key, absl::StrCat("is ", TypeName(*node), ", must be a table"));
    reported = true;
  } else if (required) {
    ErrorAt("", absl::StrCat("table [", path, "] is missing"));
    reported = true;
  }
  impl_->missing_tables.emplace_back();
  const toml::table& stand_in = impl_->missing_tables.back();
  impl_->missing[&stand_in] = {impl_->PositionOf(self, key), reported};
  return TomlTable(impl_, &stand_in, path);
}

std::vector<TomlTable> TomlTable::Tables(std::string_view key) const {
  const toml::node* node = impl_->Take(AsTable(node_), key);
  std::vector<TomlTable> tables;
  if (node == nullptr) return tables;
  const toml::array* array = node->as_array();
  if (array == nullptr) {
    ErrorAt(key,
            absl::StrCat("is ", TypeName(*node), ", must be an array of tables, [[", key, "]]"));
    return tables;
  }
  for (size_t i = 0; i < array->size(); ++i) {
    const toml::table* table = (*array)[i].as_table();
    if (table == nullptr) {
      ErrorAt(key, absl::StrCat("element ", i, " is ", TypeName((*array)[i]), ", must be a table"));
      return {};
    }
    tables.push_back(
        TomlTable(impl_, table, absl::StrCat(path_, path_.empty() ? "" : ".", key, "[", i, "]")));
  }
  return tables;
}

std::vector<std::string> TomlTable::Keys() const {
  std::vector<std::tuple<toml::source_index, toml::source_index, std::string>> placed;
  for (const auto& [name, node] : AsTable(node_)) {
    toml::source_position at = name.source().begin;
    placed.emplace_back(at.line, at.column, std::string(name.str()));
  }
  std::sort(placed.begin(), placed.end());
  std::vector<std::string> keys;
  for (auto& [line, column, key] : placed) keys.push_back(std::move(key));
  return keys;
}

void TomlTable::Ignore() const { impl_->ignored.insert(&AsTable(node_)); }

void TomlTable::ErrorAt(std::string_view key, std::string_view message) const {
  if (!key.empty()) impl_->used[&AsTable(node_)].insert(std::string(key));
  impl_->Record(AsTable(node_), path_, key, message);
}

const std::string& TomlTable::file() const { return impl_->filename; }

std::string TomlTable::Where(std::string_view key) const {
  return impl_->Where(impl_->PositionOf(AsTable(node_), key));
}

absl::StatusOr<TomlDocument> TomlDocument::Parse(std::string_view text, std::string filename) {
  auto impl = std::make_shared<TomlTable::Impl>();
  impl->filename = std::move(filename);
  if (size_t line = LineOfTooDeepKey(text); line > 0) {
    std::string where = absl::StrCat(impl->filename, ":", line, ":1");
    return Error(absl::StatusCode::kInvalidArgument, "RIG_FILE_INVALID",
                 absl::StrCat(where, ": a key of more than ", kDeepestKey, " parts"),
                 {{"where", where}});
  }
  try {
    impl->root = toml::parse(text, impl->filename);
  } catch (const toml::parse_error& error) {
    std::string where = impl->Where(error.source().begin);
    return Error(absl::StatusCode::kInvalidArgument, "RIG_FILE_INVALID",
                 absl::StrCat(where, ": ", error.description()), {{"where", where}});
  }
  return TomlDocument(TomlTable(impl, &impl->root, ""));
}

absl::Status TomlDocument::Finish() const {
  TomlTable::Impl& impl = *root_.impl_;
  auto recorded = impl.errors;
  const size_t left_out = impl.RecordUnknown();
  std::vector<std::tuple<toml::source_index, toml::source_index, std::string>> errors;
  errors.swap(impl.errors);
  impl.errors = std::move(recorded);  // Finish() may be asked again
  if (errors.empty()) return absl::OkStatus();
  std::sort(errors.begin(), errors.end());
  // What two readers of a table say of it is said once.
  errors.erase(std::unique(errors.begin(), errors.end()), errors.end());
  std::vector<std::string> lines;
  for (const auto& [line, column, text] : errors) {
    if (lines.size() == kMostErrors) break;
    lines.push_back(text);
  }
  // The last of the ten lines says how much is left.
  const size_t count = errors.size() + left_out;
  if (count > kMostErrors) lines.back() = absl::StrCat("and ", count - kMostErrors + 1, " more");
  return Error(absl::StatusCode::kInvalidArgument, "RIG_FILE_INVALID", absl::StrJoin(lines, "\n"),
               {{"file", impl.filename}, {"errors", absl::StrCat(count)}});
}

std::string TomlQuoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      absl::StrAppend(&out, "\\", std::string_view(&c, 1));
    } else if (absl::ascii_iscntrl(static_cast<unsigned char>(c))) {
      absl::StrAppendFormat(&out, "\\u%04x", static_cast<unsigned char>(c));
    } else {
      out += c;
    }
  }
  return out + "\"";
}

}  // namespace lightstage
