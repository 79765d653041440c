// Processors without AVX2 to choose.
#include "sim/render/kernels.h"

namespace lightstage::sim {

const Kernels& Avx2Kernels() { return BaselineKernels(); }
const Kernels& BestKernels() { return BaselineKernels(); }

}  // namespace lightstage::sim
