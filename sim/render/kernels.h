// The inner loops of the renderer: eight samples at a time through Embree's packets. The same source is compiled for AVX-512, for
// AVX2 and for the baseline; the machine decides at run time. This header and the kernels' sources hold no inline function of ours or of
// a library's, for the linker could keep its AVX2 copy for everybody.
#pragma once

#include <embree3/rtcore.h>
#include <stddef.h>
#include <stdint.h>

namespace lightstage::sim {

inline constexpr int kLanes = 8;

// What Scene's media need of every question for occlusion: the lane's number in ray.id, a zero here before, and then transmittance is
// exp(−optical_depth).
struct ShadowContext {
  RTCIntersectContext embree;  // the first member: Embree hands it to the media
  float optical_depth[kLanes];
};

// What light may be stopped by.
struct Blockers {
  RTCScene scene;  // Scene::handle()
  RTCScene parts;  // of the rig, where they are at this pose (rig_parts.h); null if there are none
};

// Vertices of camera paths (paths.h), arrays of a multiple of kLanes floats, 32-byte aligned. Arrays may be one and the same.
struct VertexArrays {
  const float *x, *y, *z;  // just above the surface, where rays start
  // Unit shading normal on the viewer's side; 0 in a medium, and where no light can be connected.
  const float *nx, *ny, *nz;
  const float* medium;           // 1 for a point inside a scattering medium, else 0
  const float *vx, *vy, *vz;     // unit, towards the viewer: where the path comes from
  const float *tr, *tg, *tb;     // throughput from the viewer to here
  const float *dr, *dg, *db;     // diffuse albedo; of a medium: of one scattering
  const float *sr, *sg, *sb;     // specular reflectance at normal incidence
  const float* roughness;        // GGX α; of a medium: mean cosine of the scattering angle
  const float* share;            // probability with which the glossy layer is sampled
  const float* mis;              // 1 if a light that the next ray meets counts too, else 0
  const float *disc_x, *disc_y;  // the vertex' own point of the unit disc
  // The next ray: unit direction, throughput from the viewer to behind it, its density (+inf: the only way), and its length.
  const float *wx, *wy, *wz;
  const float *fr, *fg, *fb;
  const float* pdf;
  const float* reach;
};
inline constexpr int kVertexFloats = 32;

struct alignas(32) Lanes {
  float v[kLanes];
};

// Eight vertices; the members are those of VertexArrays.
struct VertexPacket {
  Lanes x, y, z, nx, ny, nz, medium, vx, vy, vz, tr, tg, tb, dr, dg, db, sr, sg, sb, roughness,
      share, mis, disc_x, disc_y, wx, wy, wz, fr, fg, fb, pdf, reach;
};

// Triangles that eight rays have met: corners, and the normals there.
struct TrianglePacket {
  Lanes a[3], b[3], c[3], na[3], nb[3], nc[3];
};

// What eight rays have met: points, unit normals of the triangles and for shading, both on the rays' side, and the material there.
struct SurfacePacket {
  Lanes x, y, z, fx, fy, fz, nx, ny, nz;
  Lanes side;  // 1 where the ray comes from the outer side, −1 from the inner one
  Lanes dr, dg, db, sr, sg, sb, roughness;
};

// What scattering there needs: throughput so far, and points of the unit square.
struct SamplePacket {
  Lanes tr, tg, tb;
  Lanes disc_u, disc_v;  // for the vertex' point of the disc
  Lanes u, v, choice;    // for the next ray; choice: between the glossy layer and its base
  Lanes on;  // 1 if the path is to go on, 0 if not: a next ray only for the balance heuristic
};

// A Lambertian disc: radiant intensity · cosine of the angle from its axis, on the side where the axis points.
struct DiscLight {
  float center[3];
  float u[3], v[3];  // its radius along two axes across
  float axis[3];     // unit, where it shines
  float radius;      // > 0
  float intensity;   // W/sr along the axis
};

// A projector that lights a wall square to its axis, in its focus plane, evenly: a thin lens of radiance intensity / (area · cos⁴) for a
// pixel whose middle ray leaves at an angle of that cosine from the axis.
struct LensLight {
  float position[3];  // the lens' middle
  float right[3], down[3], forward[3];
  float u[3], v[3];    // its radius along two axes across; 0: a pinhole
  float radius;        // ≥ 0
  float focus;         // distance of the plane in focus, along the axis; > 0
  float tan_x, tan_y;  // of the half angles
  int32_t width, height;
  float intensity;  // W/sr along the axis
};

// One direction per vertex towards light that is infinitely far away: unit vectors, radiance over the direction's density, and that
// density, 1/sr. A zero density: no light.
struct FarLight {
  const float *x, *y, *z;
  const float *r, *g, *b;
  const float* pdf;
};

constexpr uint32_t kUnlit = 0xffffffffu;

struct Kernels {
  const char* name;
  // Points and normals, for rays that have met triangles.
  void (*triangles)(const RTCRayHit8& rays, const TrianglePacket& triangles, SurfacePacket* out);
  // The vertices where the rays end; `reach` is 0.
  void (*surface)(const RTCRayHit8& rays, const SurfacePacket& surface, const SamplePacket& samples,
                  VertexPacket* out);
  // What the light adds, by way of each of `count` vertices (a multiple of kLanes), to the radiance that the viewer sees,
  // W/(m²·sr).
  void (*disc)(const Blockers& blockers, const VertexArrays& vertices, const DiscLight& light,
               size_t count, float* r, float* g, float* b);
  // Likewise with the projector all white, and the projector's pixel (row · width + column) that lights each vertex; kUnlit where
  // none does. Vertex i has two places: i for light by connection, and, only if the radius is not 0, count + i for what its next ray
  // meets.
  void (*lens)(const Blockers& blockers, const VertexArrays& vertices, const LensLight& light,
               size_t count, uint32_t* pixel, float* r, float* g, float* b);
  // By connection only: what the next rays meet is for the caller to add, with the balance heuristic.
  void (*far)(const Blockers& blockers, const VertexArrays& vertices, const FarLight& light,
              size_t count, float* r, float* g, float* b);
  // sum_r[i] += values[source[i]] · r[i], and so on.
  void (*gather)(const float* values, const int32_t* source, const float* r, const float* g,
                 const float* b, size_t count, float* sum_r, float* sum_g, float* sum_b);
};

const Kernels& BaselineKernels();
const Kernels& Avx2Kernels();    // only to be run where the processor has AVX2 and FMA
const Kernels& Avx512Kernels();  // likewise AVX-512 F, VL and DQ

// Those that this machine can run, the best first.
constexpr int kMostKernels = 3;
int UsableKernels(const Kernels* usable[kMostKernels]);
const Kernels& BestKernels();

}  // namespace lightstage::sim
