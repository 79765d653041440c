// Strict reading of JSON: missing keys, wrong types and values out of range are errors that name their place, e.g.
// "manifest.json: shots[12].checks.mean: is a string, must be a number".
//
// Sticky, as base/toml.h: the first error of a document is kept, getters go on with a default, and status() tells at the end.
// Keys that nobody reads are allowed: later versions may add some.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace lightstage {

// Keeps the order of keys as written, so that files read as they are documented.
using Json = nlohmann::ordered_json;

// INVALID_ARGUMENT / JSON_INVALID with `name` and the place if it is not JSON.
absl::StatusOr<Json> ParseJson(std::string_view text, std::string_view name);

// A view of one JSON value; the value must outlive it. `name` of the document stands before every place. Not thread-safe.
class JsonReader {
 public:
  JsonReader(const Json& value, std::string name);

  double Double(const char* key, double lo = -std::numeric_limits<double>::max(),
                double hi = std::numeric_limits<double>::max()) const;
  int64_t Int(const char* key, int64_t lo = std::numeric_limits<int64_t>::min(),
              int64_t hi = std::numeric_limits<int64_t>::max()) const;
  uint64_t Uint(const char* key, uint64_t hi = std::numeric_limits<uint64_t>::max()) const;
  bool Bool(const char* key) const;
  std::string String(const char* key) const;
  // Exactly `count` numbers.
  std::vector<double> Doubles(const char* key, size_t count) const;

  // False for null as for a missing key.
  bool Has(const char* key) const;
  JsonReader Object(const char* key) const;
  std::vector<JsonReader> Objects(const char* key) const;
  // The value at `key` as it is; null if missing (an error).
  const Json& Value(const char* key) const;

  // Records an error at `key`, for checks only the reader can make.
  void ErrorAt(const char* key, std::string_view message) const;
  // INVALID_ARGUMENT / JSON_INVALID: the first error of the whole document.
  const absl::Status& status() const { return *status_; }

 private:
  JsonReader(const Json& value, std::string path, std::shared_ptr<absl::Status> status);
  const Json* Find(const char* key) const;

  const Json* value_;
  std::string path_;
  std::shared_ptr<absl::Status>
      status_;  // shared: all views of one document record the first error in one place
};

}  // namespace lightstage
