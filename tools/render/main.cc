#include <sys/ioctl.h>
#include <unistd.h>

#include <iostream>
#include <string>
#include <vector>

#include "tools/render/app.h"

int main(int argc, char** argv) {
  return lightstage::sim::RunApp(std::vector<std::string>(argv + 1, argv + argc), std::cout,
                                 std::cerr, isatty(STDERR_FILENO) != 0);
}
