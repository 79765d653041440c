// The rig files that people start from must be right. What is inside a driver's own table is the driver's to test: this room is
// below them.
#include <gtest/gtest.h>

#include <string>

#include "base/env.h"
#include "daemon/config/rig_file.h"

namespace lightstage {
namespace {

template <class Device>
Driver<Device> AnyDriver(bool on_virtual_time) {
  return {[](const TomlTable& table) -> DeviceOpener<Device> {
            table.String("driver", "");
            table.Ignore();
            return [](const DeviceContext&) -> absl::StatusOr<std::unique_ptr<Device>> {
              return absl::UnimplementedError("no device");
            };
          },
          on_virtual_time};
}

TEST(ExampleRigs, Parse) {
  DriverRegistry drivers;
  drivers.cameras["sim"] = AnyDriver<Camera>(true);
  drivers.axes["sim"] = AnyDriver<Axis>(true);
  drivers.lamps["sim"] = AnyDriver<Lamps>(true);
  drivers.projectors["sim"] = AnyDriver<Projector>(true);
  drivers.cameras["aravis"] = AnyDriver<Camera>(false);
  drivers.cameras["sim-gige"] = AnyDriver<Camera>(false);
  drivers.tables["simulation"] = [](const TomlTable& table) { table.Ignore(); };
  std::string folder = std::string(LIGHTSTAGE_SOURCE_DIR) + "/examples/rigs";
  auto names = PosixEnv().List(folder);
  ASSERT_TRUE(names.ok()) << names.status();
  EXPECT_FALSE(names->empty());
  for (const std::string& name : *names) {
    auto text = PosixEnv().ReadFile(folder + "/" + name);
    ASSERT_TRUE(text.ok()) << text.status();
    auto rig = ParseRigFile(*text, name, drivers);
    EXPECT_TRUE(rig.ok()) << rig.status();
  }
}

}  // namespace
}  // namespace lightstage
