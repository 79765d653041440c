#include "sim/render/kernels.h"

namespace lightstage::sim {

int UsableKernels(const Kernels* usable[kMostKernels]) {
  int count = 0;
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512dq")) {
    usable[count++] = &Avx512Kernels();
  }
  if (avx2) usable[count++] = &Avx2Kernels();
  usable[count++] = &BaselineKernels();
  return count;
}

const Kernels& BestKernels() {
  static const Kernels* const kBest = [] {
    const Kernels* usable[kMostKernels];
    UsableKernels(usable);
    return usable[0];
  }();
  return *kBest;
}

}  // namespace lightstage::sim
