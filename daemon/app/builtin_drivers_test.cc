#include "daemon/app/builtin_drivers.h"

#include <filesystem>

#include "base/env.h"
#include "daemon/config/rig_file.h"
#include "gtest/gtest.h"

namespace lightstage {
namespace {

// Down to the drivers' own keys: what the example files say is what the drivers of this binary read.
TEST(BuiltinDrivers, EveryExampleRigIsGood) {
  int examples = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(LIGHTSTAGE_SOURCE_DIR "/examples/rigs")) {
    std::string path = entry.path();
    auto text = PosixEnv().ReadFile(path);
    ASSERT_TRUE(text.ok()) << text.status();
    DriverRegistry drivers;
    RegisterBuiltinDrivers(drivers);
    auto file = ParseRigFile(*text, path, drivers);
    EXPECT_TRUE(file.ok()) << file.status();
    ++examples;
  }
  EXPECT_GE(examples, 3);
}

}  // namespace
}  // namespace lightstage
