#include "sim/render/kernels.h"

namespace lightstage::sim {

const Kernels& BestKernels() {
  static const bool kHasAvx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return kHasAvx2 ? Avx2Kernels() : BaselineKernels();
}

}  // namespace lightstage::sim
