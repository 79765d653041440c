#include "drivers/dlpc350/options.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "base/status.h"

namespace lightstage::dlpc350 {
namespace {

constexpr int kMaxImages = 64;      // entries of the image table
constexpr int kImageBits = 24;      // bit planes of an image
constexpr uint32_t kBlackUs = 230;  // what the mirrors need between exposures that do not touch

template <class Enum>
Enum Choice(const TomlTable& table, std::string_view key,
            const std::vector<std::pair<std::string, Enum>>& choices,
            std::optional<std::string> fallback = {}) {
  std::vector<std::string> names;
  for (const auto& [name, value] : choices) names.push_back(name);
  const std::string chosen = table.OneOf(key, names, std::move(fallback));
  for (const auto& [name, value] : choices) {
    if (name == chosen) return value;
  }
  return choices.front().second;
}

int Int(const TomlTable& table, std::string_view key, int lo, int hi, std::optional<int> fallback) {
  return static_cast<int>(table.Int(key, lo, hi, fallback));
}

void Add(const TomlTable& table, const Pattern& pattern, const StoredPattern& where,
         Options* options) {
  if (absl::Status valid = Validate(pattern); !valid.ok()) {
    table.ErrorAt("", MessageOf(valid));
  } else if (where.image >= kMaxImages) {
    table.ErrorAt("", absl::StrCat(PatternName(pattern), " would be in image ", where.image,
                                   "; the last one is ", kMaxImages - 1));
  } else if (!options->patterns.emplace(Canonical(pattern), where).second) {
    table.ErrorAt("", absl::StrCat(PatternName(pattern), " has a place already"));
  }
}

// One entry of [[patterns]].
void ParsePattern(const TomlTable& table, Options* options) {
  Pattern pattern;
  pattern.arrangement = Choice<PatternArrangement>(table, "arrangement",
                                                   {{"full", PatternArrangement::kFull},
                                                    {"square", PatternArrangement::kSquare},
                                                    {"horizontal", PatternArrangement::kHorizontal},
                                                    {"vertical", PatternArrangement::kVertical}});
  const bool every_square = table.Bool("every_square", false);
  if (pattern.arrangement != PatternArrangement::kFull) {
    pattern.profile = Choice<PatternProfile>(table, "profile",
                                             {{"box", PatternProfile::kBox},
                                              {"gaussian", PatternProfile::kGaussian},
                                              {"hat", PatternProfile::kHat}},
                                             "box");
    pattern.grid = Int(table, "grid", 1, 1024, {});
    pattern.influence = Int(table, "influence", 0, 1023, 0);
    if (!every_square) {
      pattern.column = Int(table, "column", 0, 1023, {});
      pattern.row = Int(table, "row", 0, 1023, {});
    }
  }
  StoredPattern where;
  where.depth = Int(table, "depth", 1, 8, {});
  const int numbers = kImageBits / where.depth;
  where.number = Int(table, "number", 0, where.depth == 1 ? kImageBits : numbers - 1, 0);
  where.image = Int(table, "image", 0, kMaxImages - 1, {});
  where.invert = table.Bool("invert", false);
  if (!every_square) return Add(table, pattern, where, options);
  if (pattern.arrangement != PatternArrangement::kSquare) {
    return table.ErrorAt("every_square", "is for arrangement = \"square\" only");
  }
  if (where.number >= numbers) {
    return table.ErrorAt(
        "number", absl::StrCat("must be from 0 to ", numbers - 1, " where the squares begin"));
  }
  if (pattern.grid * pattern.grid > kMaxImages * kImageBits) {
    return table.ErrorAt(
        "grid", absl::StrCat("has more squares than ", kMaxImages, " images have bit planes"));
  }
  for (pattern.row = 0; pattern.row < pattern.grid; ++pattern.row) {
    for (pattern.column = 0; pattern.column < pattern.grid; ++pattern.column) {
      if (where.number >= numbers) {
        where.number = 0;
        ++where.image;
      }
      if (where.image >= kMaxImages) {
        return table.ErrorAt("image",
                             absl::StrCat("the squares do not fit into the images from here "
                                          "on; the last one is ",
                                          kMaxImages - 1));
      }
      Add(table, pattern, where, options);
      ++where.number;
    }
  }
}

void ParseFlash(const TomlTable& table, Options* options) {
  options->leds = Choice<int>(table, "leds",
                              {{"red", 1},
                               {"green", 2},
                               {"yellow", 3},
                               {"blue", 4},
                               {"magenta", 5},
                               {"cyan", 6},
                               {"white", 7}},
                              "white");
  options->exposure_us = static_cast<uint32_t>(table.Int("exposure_us", 235, 500000, 8400));
  options->period_us =
      static_cast<uint32_t>(table.Int("period_us", 235, 500000, options->exposure_us));
  if (options->period_us != options->exposure_us &&
      options->period_us < options->exposure_us + kBlackUs) {
    table.ErrorAt(table.Has("period_us") ? "period_us" : "exposure_us",
                  absl::StrCat("must be exposure_us, or at least ", kBlackUs, " more"));
  }
  options->trigger_in =
      Choice<int>(table, "trigger_in", {{"none", 0}, {"rising", 1}, {"falling", 2}}, "none");
  if (options->trigger_in != 0 && options->period_us < options->exposure_us + kBlackUs) {
    table.ErrorAt("trigger_in", absl::StrCat("needs black between exposures: period_us at least ",
                                             kBlackUs, " more than exposure_us"));
  }
  options->trigger_in_delay_us = table.Double("trigger_in_delay_us", 0, 56000, 0.0);
  auto delay = [&](std::string_view key) {
    return EncodeTriggerOutDelay(table.Double(key, -20.05, 2.787, 0.0));
  };
  options->trigger_out1 = {table.Bool("trigger_out1_invert", false), delay("trigger_out1_rise_us"),
                           delay("trigger_out1_fall_us")};
  options->trigger_out2 = {table.Bool("trigger_out2_invert", false), delay("trigger_out2_rise_us")};
  for (const TomlTable& pattern : table.Tables("patterns")) ParsePattern(pattern, options);
  if (options->patterns.empty()) {
    table.ErrorAt("patterns", "mode = \"flash\" needs [[….patterns]]: what is stored where");
  }
}

}  // namespace

Pattern Canonical(Pattern pattern) {
  switch (pattern.arrangement) {
    case PatternArrangement::kBlack:
    case PatternArrangement::kFull:
      return Pattern{.arrangement = pattern.arrangement};
    case PatternArrangement::kSquare:
      pattern.influence = 0;
      return pattern;
    case PatternArrangement::kHorizontal:
    case PatternArrangement::kVertical:
      return pattern;
  }
  return pattern;
}

Options ParseOptions(const TomlTable& table) {
  Options options;
  options.flash = table.OneOf("mode", {"flash", "video"}) == "flash";
  options.path = table.String("path", "");
  options.serial = table.String("serial", "");
  const double limit = table.Double("led_current_limit", 0, 255);
  const std::vector<double> current = table.Doubles("led_current", 0, 255, 3);
  for (size_t i = 0; i < std::min<size_t>(current.size(), 3); ++i) {
    if (current[i] > limit) {
      table.ErrorAt("led_current",
                    absl::StrCat("is ", current[i], ", above led_current_limit, which is ", limit));
    }
    options.current[i] = static_cast<uint8_t>(current[i]);
    if (options.current[i] != current[i]) table.ErrorAt("led_current", "must be whole numbers");
  }
  options.settle = table.Time("settle_ms", 0, 2000, 0.0);
  if (options.flash) ParseFlash(table, &options);
  return options;
}

}  // namespace lightstage::dlpc350
