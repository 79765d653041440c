#include "daemon/app/discover.h"

#include <sstream>

#include "base/status.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

TEST(Discover, SaysWhatThereIsWhatIsNotAndWhy) {
  DriverRegistry drivers;
  drivers.discoveries["can"] = []() -> absl::StatusOr<std::vector<Discovered>> {
    return Error(absl::StatusCode::kUnavailable, "BUS", "this kernel has no CAN");
  };
  drivers.discoveries["dmx"] = [] { return std::vector<Discovered>(); };
  drivers.discoveries["hid"] = [] {
    return std::vector<Discovered>{{"a projector \xff", "[projector]\ndriver = \"hid\"\n"}};
  };
  std::ostringstream out;
  Discover(drivers, out);
  EXPECT_EQ(out.str(),
            "can: this kernel has no CAN\n\n"
            "dmx: nothing found\n\n"
            "hid: a projector \xef\xbf\xbd\n\n[projector]\ndriver = \"hid\"\n\n");
}

}  // namespace
}  // namespace lightstage
