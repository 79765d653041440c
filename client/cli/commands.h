// The commands of lightstagectl, one function and one file per group. Each adds its subcommands;
// when one is given on the command line, `chosen` becomes what is to be done. Nothing is done, and
// nobody is contacted, while the line is being read.
#pragma once

#include "CLI/App.hpp"
#include "client/cli/session.h"

namespace lightstage::client {

void AddRigCommands(CLI::App& app, Command& chosen);     // status, rig, stop, reset
void AddPlanCommands(CLI::App& app, Command& chosen);    // plan, capture
void AddRunsCommands(CLI::App& app, Command& chosen);    // runs …
void AddManualCommands(CLI::App& app, Command& chosen);  // move, lamps, pattern, snap

}  // namespace lightstage::client
