// lightstage-render: pictures of the simulated world without rig, camera chip or capture, to compare captured and relit ones with.
#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace lightstage::sim {

// Runs one command line (without the program's name); the exit code. Progress goes to `err`: a line that is redrawn if it is a
// terminal, else a line every few seconds.
int RunApp(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err,
           bool err_is_terminal);

}  // namespace lightstage::sim
