// lightstagectl without its main(): from arguments to exit code.
#pragma once

#include <string>
#include <vector>

#include "client/cli/session.h"

namespace lightstage::client {

// `arguments` are without the program's name.
ExitCode RunCli(const std::vector<std::string>& arguments, World& world);

}  // namespace lightstage::client
