// What the camera's rays meet. Object and camera ride on the turntable together, so this is traced once per scene and size, and
// only the lights move.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "optics/rig_geometry.h"
#include "sim/render/kernels.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

class Film {
 public:
  // `samples` rays per pixel, [1, 256], spread over the pixel. The same for the same seed.
  Film(const Scene& scene, const CameraGeometry& camera, int width, int height, int samples,
       uint64_t seed);

  int width() const { return width_; }
  int height() const { return height_; }
  int samples() const { return samples_; }
  // Samples of one row of pixels, in order of x, then of sample; rows are padded to a multiple of 8.
  size_t row_stride() const { return row_stride_; }
  const HitArrays& hits() const { return hits_; }

 private:
  static constexpr int kArrays = 15;
  struct Free {
    void operator()(float* p) const;
  };

  void TraceRow(const Scene& scene, const CameraGeometry& camera, uint64_t seed, int y);
  float* array(int k) const { return data_.get() + row_stride_ * height_ * k; }

  const int width_, height_, samples_;
  const size_t row_stride_;
  std::unique_ptr<float[], Free> data_;
  HitArrays hits_;
};

}  // namespace lightstage::sim
