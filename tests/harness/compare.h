// Two captures of one plan, image by image.
#pragma once

#include <string>

#include "tests/harness/daemon.h"

namespace lightstage {

struct BasisComparison {
  int images = 0;
  double worst = 0;   // greatest difference of two pixels, in steps
  std::string where;  // which image and pixel
};

// Compares all basis images of two finished runs; fails the test if their numbers or shapes differ, or if a run has an image whose pixels are all the
// same. A step is what the pixels of a good pair may differ by: a code of `bits` in the bracket's longest exposure, `exposure_s`, and one
// step of the file's half precision.
BasisComparison CompareBasis(Daemon& a, const std::string& run_a, Daemon& b,
                             const std::string& run_b, int bits, double exposure_s);

// `rig` with another text in place of the table [name], its sub-tables apart.
std::string WithTable(const std::string& rig, const std::string& name, const std::string& text);

}  // namespace lightstage
