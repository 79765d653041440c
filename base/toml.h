// Strict reading of TOML: every key must be read by somebody, have the right type and lie in its range; otherwise the error says
// "file:line:column: [table] key: what is wrong, what would be right".
//
// Reading is sticky: a getter that fails records the error and returns its fallback (or a default), so that parsing code reads
// like the file. Nothing read may be used before TomlDocument::Finish() returned OK. Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "base/clock.h"

namespace lightstage {

// A view of one table of a TomlDocument; cheap to copy. The document must outlive it.
class TomlTable {
 public:
  // Ranges are inclusive. Without a fallback the key is required. NaN and infinity are out of every range.
  double Double(std::string_view key, double lo, double hi,
                std::optional<double> fallback = {}) const;
  int64_t Int(std::string_view key, int64_t lo, int64_t hi,
              std::optional<int64_t> fallback = {}) const;
  bool Bool(std::string_view key, std::optional<bool> fallback = {}) const;
  std::string String(std::string_view key, std::optional<std::string> fallback = {}) const;
  std::string OneOf(std::string_view key, const std::vector<std::string>& choices,
                    std::optional<std::string> fallback = {}) const;
  // A number whose key names its unit: _us, _ms or _s (range in the key's unit).
  Duration Time(std::string_view key, double lo, double hi,
                std::optional<double> fallback = {}) const;
  // `count` < 0: any number of elements.
  std::vector<double> Doubles(std::string_view key, double lo, double hi, int count = -1,
                              std::optional<std::vector<double>> fallback = {}) const;

  bool Has(std::string_view key) const;
  // A sub-table; missing counts as empty if not required.
  TomlTable Table(std::string_view key, bool required = false) const;
  // An array of tables ([[key]]); empty if missing.
  std::vector<TomlTable> Tables(std::string_view key) const;
  // All keys of this table, in file order (for tables whose keys are names).
  std::vector<std::string> Keys() const;

  // Nobody will read this table, for a reason that is an error already: its keys and what is below them are not further ones.
  void Ignore() const;

  // Records an error at `key` (at the table itself if the key is missing or empty): for checks that only the reader can make.
  void ErrorAt(std::string_view key, std::string_view message) const;
  // "file:line:column" of the key or, if it is missing or empty, of the table.
  std::string Where(std::string_view key = {}) const;
  const std::string& path() const { return path_; }
  // The document's file, as it was given to Parse.
  const std::string& file() const;

 private:
  friend class TomlDocument;
  struct Impl;
  TomlTable(std::shared_ptr<Impl> impl, const void* node, std::string path);
  std::shared_ptr<Impl>
      impl_;  // shared: every view of a document records its errors and its used keys in one place
  const void* node_;  // a toml::table; an empty one of the document's own for a missing table
  std::string path_;
};

// `text` as a basic string, quotes and all: for lines that are to be pasted into a file.
std::string TomlQuoted(std::string_view text);

class TomlDocument {
 public:
  // INVALID_ARGUMENT with file:line:column if it is not TOML.
  static absl::StatusOr<TomlDocument> Parse(std::string_view text, std::string filename);
  const TomlTable& root() const { return root_; }
  // The errors recorded so far and the keys that nobody read, at most ten lines: INVALID_ARGUMENT, reason RIG_FILE_INVALID.
  absl::Status Finish() const;

 private:
  explicit TomlDocument(TomlTable root) : root_(std::move(root)) {}
  TomlTable root_;
};

}  // namespace lightstage
