#include "daemon/app/discover.h"

#include "base/status.h"
#include "base/utf8.h"

namespace lightstage {

void Discover(const DriverRegistry& drivers, std::ostream& out) {
  for (const auto& [name, discover] : drivers.discoveries) {
    const absl::StatusOr<std::vector<Discovered>> found = discover();
    if (!found.ok()) {
      out << name << ": " << MessageOf(found.status()) << "\n\n";
      continue;
    }
    if (found->empty()) out << name << ": nothing found\n\n";
    for (const Discovered& device : *found) {
      // What devices say of themselves may be anything.
      out << name << ": " << CleanUtf8(device.what) << "\n\n" << CleanUtf8(device.toml) << "\n";
    }
  }
}

}  // namespace lightstage
