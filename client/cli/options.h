// Command-line options whose text is read by the functions of values.h, so that every refusal reads
// alike and "nan" is refused.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/status/statusor.h"
#include "base/strings.h"
#include "client/cli/session.h"

namespace lightstage::client {

// Tells CLI11 that a value was refused; it catches this itself.
[[noreturn]] void RefuseValue(const std::string& name, const absl::Status& status);

// An option or (without leading dashes) a positional whose text `parse` reads into `value`, which
// must outlive the parsing.
template <class T, class Parsed>
CLI::Option* AddParsed(CLI::App& command, const std::string& name, T& value,
                       absl::StatusOr<Parsed> (*parse)(const std::string&), const std::string& type,
                       const std::string& description) {
  return command
      .add_option_function<std::string>(
          name,
          [&value, name, parse](const std::string& text) {
            auto parsed = parse(text);
            if (!parsed.ok()) RefuseValue(name, parsed.status());
            value = *std::move(parsed);
          },
          description)
      ->type_name(type);
}

// Positional words that are joined by commas before `parse` reads them.
template <class T, class Parsed>
CLI::Option* AddParsedWords(CLI::App& command, const std::string& name, T& value,
                            absl::StatusOr<Parsed> (*parse)(const std::string&),
                            const std::string& type, const std::string& description) {
  return command
      .add_option_function<std::vector<std::string>>(
          name,
          [&value, name, parse](const std::vector<std::string>& words) {
            std::string text;
            for (const std::string& word : words) text += (text.empty() ? "" : ",") + word;
            auto parsed = parse(text);
            if (!parsed.ok()) RefuseValue(name, parsed.status());
            value = *std::move(parsed);
          },
          description)
      ->type_name(type);
}

}  // namespace lightstage::client
