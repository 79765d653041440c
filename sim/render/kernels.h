// The inner loops of the renderer: eight samples at a time through Embree's packets. The same source is compiled twice, for AVX2
// and for the baseline; the machine decides at run time. This header and the kernels' sources hold no inline function of ours or of
// a library's, for the linker could keep its AVX2 copy for everybody.
#pragma once

#include <embree3/rtcore.h>
#include <stddef.h>
#include <stdint.h>

namespace lightstage::sim {

// What the camera sees, one entry per sample; a sample that sees nothing has a zero normal. Arrays of a multiple of 8 floats,
// 32-byte aligned.
struct HitArrays {
  const float *x, *y, *z;        // just above the surface, where shadow rays start
  const float *nx, *ny, *nz;     // unit shading normal on the camera's side
  const float *dr, *dg, *db;     // diffuse albedo
  const float *sr, *sg, *sb;     // specular reflectance at normal incidence
  const float* roughness;        // GGX α
  const float *disc_x, *disc_y;  // each sample's own point of the unit disc
  float camera[3];
};

// A Lambertian disc: radiant intensity · cosine of the angle from its axis.
struct DiscLight {
  float center[3];
  float u[3], v[3];  // its radius along two axes across
  float axis[3];     // unit, where it shines
  float intensity;   // W/sr along the axis
};

// A pinhole projector that lights a wall square to its axis evenly: intensity / cos³ of the angle from the axis.
struct PinholeLight {
  float position[3];
  float right[3], down[3], forward[3];
  float tan_x, tan_y;  // of the half angles
  int32_t width, height;
  float intensity;  // W/sr along the axis
};

constexpr uint32_t kUnlit = 0xffffffffu;

struct Kernels {
  const char* name;
  // Radiance, W/(m²·sr), of the samples [begin, end) into r/g/b[0 … end−begin). Both bounds are multiples of 8.
  void (*disc)(RTCScene scene, const HitArrays& hits, const DiscLight& light, size_t begin,
               size_t end, float* r, float* g, float* b);
  // Likewise with the projector all white, and the projector's pixel (row · width + column) that lights each sample; kUnlit
  // where none does.
  void (*pinhole)(RTCScene scene, const HitArrays& hits, const PinholeLight& light, size_t begin,
                  size_t end, uint32_t* pixel, float* r, float* g, float* b);
};

const Kernels& BaselineKernels();
const Kernels& Avx2Kernels();  // only to be run where the processor has AVX2 and FMA
const Kernels& BestKernels();  // for this machine

}  // namespace lightstage::sim
