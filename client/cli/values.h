// What a user types on the command line, read strictly: every function takes one whole word and
// returns INVALID_ARGUMENT / USAGE with what would be right. Only the form is checked here; whether
// a value suits the rig is the daemon's to say.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "lightstage/v1/rig.pb.h"
#include "lightstage/v1/types.pb.h"

namespace lightstage::client {

absl::Status UsageError(const std::string& message);

// A finite decimal number: "nan" and "inf" are none.
absl::StatusOr<double> ParseNumber(const std::string& text);
// A number that is not negative.
absl::StatusOr<double> ParseDuration(const std::string& text);
absl::StatusOr<int> ParseInteger(const std::string& text);

// "500,4000": numbers with commas between.
absl::StatusOr<std::vector<double>> ParseNumbers(const std::string& text);

// A count ("32"), or angles in degrees if there is a comma or a decimal point ("0,15,30", "45.").
using CountOrAngles = std::variant<int, std::vector<double>>;
absl::StatusOr<CountOrAngles> ParseCountOrAngles(const std::string& text);

// "0-19", "0,3,7-9", in that order; "all" is the empty list.
absl::StatusOr<std::vector<int>> ParseLamps(const std::string& text);

// "3=1.0", "0-19=0.5", several with commas between.
absl::StatusOr<std::vector<v1::LampLevel>> ParseLampLevels(const std::string& text);

// "box", "gaussian" or "hat".
absl::StatusOr<v1::PatternProfile> ParseProfile(const std::string& text);

// An arrangement ("black", "full", "square", "horizontal", "vertical"), then any of "grid=N",
// "column=N", "row=N", "influence=N", "profile=box|gaussian|hat", with commas between.
absl::StatusOr<v1::Pattern> ParsePattern(const std::string& text);

// "turntable" or "tilt".
absl::StatusOr<v1::AxisId> ParseAxis(const std::string& text);

// "runs/ID" or "ID" as the resource name; "latest" stays as it is.
inline constexpr char kLatestRun[] = "latest";
absl::StatusOr<std::string> ParseRun(const std::string& text);

}  // namespace lightstage::client
