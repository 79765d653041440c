#include "dataset/json_reader.h"

#include <cmath>

#include "base/status.h"

namespace lightstage {
namespace {

const Json& Null() {
  static const Json& null = *new Json();
  return null;
}

}  // namespace

absl::StatusOr<Json> ParseJson(std::string_view text, std::string_view name) {
  try {
    return Json::parse(text);
  } catch (const nlohmann::json::exception& e) {
    return Error(absl::StatusCode::kInvalidArgument, "JSON_INVALID",
                 absl::StrCat(name, ": ", e.what()), {{"file", std::string(name)}});
  }
}

JsonReader::JsonReader(const Json& value, std::string name)
    : JsonReader(value, std::move(name) + ": ", std::make_shared<absl::Status>()) {
  if (!value.is_object())
    ErrorAt("", absl::StrCat("is ", value.type_name(), ", must be an object"));
}

JsonReader::JsonReader(const Json& value, std::string path, std::shared_ptr<absl::Status> status)
    : value_(&value), path_(std::move(path)), status_(std::move(status)) {}

void JsonReader::ErrorAt(const char* key, std::string_view message) const {
  if (!status_->ok()) return;
  std::string place = absl::StrCat(path_, key);
  *status_ = Error(absl::StatusCode::kInvalidArgument, "JSON_INVALID",
                   absl::StrCat(place, ": ", message), {{"where", place}});
}

const Json* JsonReader::Find(const char* key) const {
  if (!value_->is_object()) return nullptr;
  auto it = value_->find(key);
  return it == value_->end() ? nullptr : &*it;
}

const Json& JsonReader::Value(const char* key) const {
  const Json* found = Find(key);
  if (found != nullptr) return *found;
  ErrorAt(key, "missing");
  return Null();
}

bool JsonReader::Has(const char* key) const {
  const Json* found = Find(key);
  return found != nullptr && !found->is_null();
}

double JsonReader::Double(const char* key, double lo, double hi) const {
  const Json& value = Value(key);
  if (!value.is_number()) {
    ErrorAt(key, absl::StrCat("is ", value.type_name(), ", must be a number"));
    return 0;
  }
  double number = value.get<double>();
  if (!(number >= lo && number <= hi)) {
    ErrorAt(key, absl::StrCat("is ", number, ", must be from ", lo, " to ", hi));
  }
  return number;
}

int64_t JsonReader::Int(const char* key, int64_t lo, int64_t hi) const {
  const Json& value = Value(key);
  bool too_large = value.is_number_unsigned() && value.get<uint64_t>() > INT64_MAX;
  if (!value.is_number_integer() || too_large) {
    ErrorAt(key, absl::StrCat("is ", value.is_number() ? value.dump() : value.type_name(),
                              ", must be an integer"));
    return 0;
  }
  int64_t number = value.get<int64_t>();
  if (number < lo || number > hi) {
    ErrorAt(key, absl::StrCat("is ", number, ", must be from ", lo, " to ", hi));
  }
  return number;
}

uint64_t JsonReader::Uint(const char* key, uint64_t hi) const {
  const Json& value = Value(key);
  if (!value.is_number_unsigned()) {
    ErrorAt(key, absl::StrCat("is ", value.is_number() ? value.dump() : value.type_name(),
                              ", must be an integer from 0"));
    return 0;
  }
  uint64_t number = value.get<uint64_t>();
  if (number > hi) ErrorAt(key, absl::StrCat("is ", number, ", must be at most ", hi));
  return number;
}

bool JsonReader::Bool(const char* key) const {
  const Json& value = Value(key);
  if (value.is_boolean()) return value.get<bool>();
  ErrorAt(key, absl::StrCat("is ", value.type_name(), ", must be true or false"));
  return false;
}

std::string JsonReader::String(const char* key) const {
  const Json& value = Value(key);
  if (value.is_string()) return value.get<std::string>();
  ErrorAt(key, absl::StrCat("is ", value.type_name(), ", must be a string"));
  return "";
}

std::vector<double> JsonReader::Doubles(const char* key, size_t count) const {
  const Json& value = Value(key);
  std::vector<double> numbers;
  if (value.is_array()) {
    for (const Json& element : value) {
      if (element.is_number()) numbers.push_back(element.get<double>());
    }
  }
  if (!value.is_array() || value.size() != count || numbers.size() != count) {
    ErrorAt(key, absl::StrCat("must be an array of ", count, " numbers"));
    numbers.assign(count, 0);
  }
  return numbers;
}

JsonReader JsonReader::Object(const char* key) const {
  const Json& value = Value(key);
  if (!value.is_object())
    ErrorAt(key, absl::StrCat("is ", value.type_name(), ", must be an object"));
  return JsonReader(value, absl::StrCat(path_, key, "."), status_);
}

std::vector<JsonReader> JsonReader::Objects(const char* key) const {
  const Json& value = Value(key);
  std::vector<JsonReader> objects;
  if (!value.is_array()) {
    ErrorAt(key, absl::StrCat("is ", value.type_name(), ", must be an array"));
    return objects;
  }
  for (size_t i = 0; i < value.size(); ++i) {
    if (!value[i].is_object()) {
      ErrorAt(key,
              absl::StrCat("element ", i, " is ", value[i].type_name(), ", must be an object"));
      return {};
    }
    objects.push_back(JsonReader(value[i], absl::StrCat(path_, key, "[", i, "]."), status_));
  }
  return objects;
}

}  // namespace lightstage
