#include "sim/render/kernels.inc"

namespace lightstage::sim {

const Kernels& BaselineKernels() {
  static constexpr Kernels kKernels{"baseline", &Triangles, &Surface, &Disc, &Lens, &Far};
  return kKernels;
}

}  // namespace lightstage::sim
