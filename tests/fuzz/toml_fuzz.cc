// Rig files, scene files and drive profiles begin with this.
#include <algorithm>
#include <string>

#include "base/status.h"
#include "base/toml.h"
#include "tests/fuzz/fuzz.h"

namespace lightstage {
namespace {

// Reads every key in the way that its first letter chooses, tables and what is in them included.
void Read(const TomlTable& table, int depth, int deepest) {
  HOLDS(depth <= deepest);
  for (const std::string& key : table.Keys()) {
    HOLDS(table.Has(key));
    HOLDS(table.Where(key).starts_with("fuzz.toml:"));
    switch (key.empty() ? 0 : static_cast<unsigned char>(key.front()) % 8) {
      case 0: {
        const double value = table.Double(key, -10, 10, 3.0);
        HOLDS(value >= -10 && value <= 10);
        break;
      }
      case 1: {
        const int64_t value = table.Int(key, -10, 1000, 7);
        HOLDS(value >= -10 && value <= 1000);
        break;
      }
      case 2:
        table.Bool(key, false);
        break;
      case 3:
        table.String(key, "");
        break;
      case 4: {
        const std::string value = table.OneOf(key, {"one", "two"});
        HOLDS(value == "one" || value == "two");
        break;
      }
      case 5:
        HOLDS(table.Doubles(key, 0, 1, 3).size() == 3);
        break;
      case 6:
        for (const TomlTable& each : table.Tables(key)) Read(each, depth + 1, deepest);
        break;
      default:
        Read(table.Table(key), depth + 1, deepest);
    }
  }
}

}  // namespace
}  // namespace lightstage

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace lightstage;
  fuzz::Input in(data, size);
  const absl::StatusOr<TomlDocument> document = TomlDocument::Parse(in.text(), "fuzz.toml");
  if (!document.ok()) {
    HOLDS(ErrorReason(document.status()) == "RIG_FILE_INVALID");
    HOLDS(MessageOf(document.status()).starts_with("fuzz.toml:"));
    return 0;
  }
  // Nobody has read anything: unknown are all keys or there are none.
  HOLDS(document->Finish().ok() == document->root().Keys().empty());
  // A key has at most 100 parts; a bracket may bring another one below it.
  const auto brackets =
      std::ranges::count_if(in.text(), [](char c) { return c == '[' || c == '{'; });
  Read(document->root(), 0, 100 * static_cast<int>(1 + brackets));
  const absl::Status status = document->Finish();
  HOLDS(status == document->Finish());
  return 0;
}
