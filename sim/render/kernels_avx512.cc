// Compiled with -mavx512f -mavx512vl -mavx512dq (CMakeLists.txt).
#include "sim/render/kernels.inc"

namespace lightstage::sim {

const Kernels& Avx512Kernels() {
  static constexpr Kernels kKernels{"avx512", &Triangles, &Surface, &Disc, &Lens, &Far, &Gather};
  return kKernels;
}

}  // namespace lightstage::sim
