#include "sim/render/kernels.inc"

namespace lightstage::sim {

const Kernels& BaselineKernels() {
  static constexpr Kernels kKernels{"baseline", &Triangles, &Surface, &Disc, &Lens, &Far, &Gather};
  return kKernels;
}

}  // namespace lightstage::sim
