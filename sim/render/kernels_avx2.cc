// Compiled with -mavx2 -mfma (CMakeLists.txt).
#include "sim/render/kernels.inc"

namespace lightstage::sim {

const Kernels& Avx2Kernels() {
  static constexpr Kernels kKernels{"avx2", &Triangles, &Surface, &Disc, &Lens, &Far, &Gather};
  return kKernels;
}

}  // namespace lightstage::sim
