// Two captures of one plan, image by image.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/harness/daemon.h"

namespace lightstage {

struct BasisComparison {
  int images = 0;
  double worst = 0;   // greatest difference of two pixels, in steps
  std::string where;  // which image and pixel
};

// The folder of a run of `plan` on `rig`, which is on virtual time: captured in `folder`. If the environment's LIGHTSTAGE_DIRECT_RUNS names a folder, the
// run is there, or will be: a virtual machine gets its runs from outside.
std::filesystem::path DirectRun(const TestFolder& folder, const std::string& rig,
                                const std::vector<std::string>& plan);

// Compares all basis images of two finished runs, by their folders; fails the test if their numbers or shapes differ, or if a run has an image
// whose pixels are all the same. A step is what the pixels of a good pair may differ by: a code of `bits` in the bracket's longest exposure,
// `exposure_s`, and one step of the file's half precision.
BasisComparison CompareBasis(const std::filesystem::path& a, const std::filesystem::path& b,
                             int bits, double exposure_s);

// That a capture on `wire_rig`, in `folder`, has so many images and that they equal those of the direct run, within a step of 12 bits.
void ExpectSame(const TestFolder& folder, const std::string& direct_rig,
                const std::string& wire_rig, const std::vector<std::string>& plan, int images,
                double exposure_s);

// Rig keys of a GigE Vision camera as large as SmallRig's: [camera], [camera.options] and its peer's.
std::string SimGige(const std::string& format, const std::string& exposures_us);
std::string SimGigeOptions(int packet_size);
constexpr char kSimGigePeer[] =
    "sensor_width = 64\nsensor_height = 48\nbits = 12\nexposure_events = true\n";

// Rig keys of a projector on a display that no other test has.
std::string SimDisplay();
std::string SimDisplayOutput();  // without the driver's name

// SmallRig, or what was made of it, with a projector that has the pixels of a DLPC350's mirrors.
std::string WithMirrors(const std::string& rig);

// `rig` with another text in place of the table [name], its sub-tables apart.
std::string WithTable(const std::string& rig, const std::string& name, const std::string& text);

}  // namespace lightstage
