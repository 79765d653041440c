// Processors where there is nothing to choose.
#include "sim/render/kernels.h"

namespace lightstage::sim {

int UsableKernels(const Kernels* usable[kMostKernels]) {
  usable[0] = &BaselineKernels();
  return 1;
}

const Kernels& BestKernels() { return BaselineKernels(); }

}  // namespace lightstage::sim
