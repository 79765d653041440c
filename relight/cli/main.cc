#include <iostream>
#include <string>
#include <vector>

#include "relight/cli/app.h"

int main(int argc, char** argv) {
  return lightstage::relight::RunApp(std::vector<std::string>(argv + 1, argv + argc), std::cout,
                                     std::cerr);
}
