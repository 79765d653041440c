// relight without its main(): from arguments to exit code.
#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace lightstage::relight {

// `arguments` are without the program's name. Returns 0, 1 if something failed, 2 if the command line is wrong. Answers go to `out`, with
// --format json as one JSON object and nothing else; errors and warnings go to `err`.
int RunApp(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err);

}  // namespace lightstage::relight
