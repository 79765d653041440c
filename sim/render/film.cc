#include "sim/render/film.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <numbers>

#include "sim/render/hash.h"
#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

// Shadow rays start this far above the surface: far more than the rounding of coordinates of a metre, far less than any detail.
constexpr float kLift = 2e-5f;
constexpr std::align_val_t kAlignment{64};

float Fraction(float x) { return x - std::floor(x); }

}  // namespace

void Film::Free::operator()(float* p) const { ::operator delete[](p, kAlignment); }

Film::Film(const Scene& scene, const CameraGeometry& camera, int width, int height, int samples,
           uint64_t seed)
    : width_(width),
      height_(height),
      samples_(samples),
      row_stride_((static_cast<size_t>(width) * samples + 7) / 8 * 8) {
  const size_t floats = row_stride_ * height_ * kArrays;
  data_.reset(static_cast<float*>(::operator new[](floats * sizeof(float), kAlignment)));
  std::fill_n(data_.get(), floats, 0.0f);
  hits_ = {array(0), array(1), array(2),  array(3),  array(4),  array(5),  array(6),  array(7),
           array(8), array(9), array(10), array(11), array(12), array(13), array(14), {}};
  for (int c = 0; c < 3; ++c) hits_.camera[c] = static_cast<float>(camera.position[c]);
  ForRows(height, [&](int y) { TraceRow(scene, camera, seed, y); });
}

void Film::TraceRow(const Scene& scene, const CameraGeometry& camera, uint64_t seed, int y) {
  const ViewFrame frame = CameraFrame(camera);
  const double tan_x = std::tan(camera.field_of_view.radians() / 2);
  const double tan_y = tan_x * height_ / width_;
  const Vec3f origin = frame.position.cast<float>();
  for (int x = 0; x < width_; ++x) {
    const uint64_t pixel =
        Fold(Fold(seed, uint64_t{0x66696c6d}), static_cast<uint64_t>(y) * width_ + x);
    const float shift_x = UnitFloat(pixel), shift_y = UnitFloat(Mix(pixel));
    const float turn = UnitFloat(Mix(pixel + 1));
    const auto first = static_cast<int>(Mix(pixel + 2) % samples_);
    for (int s = 0; s < samples_; ++s) {
      const size_t i = row_stride_ * y + static_cast<size_t>(x) * samples_ + s;
      // Points in the pixel: the R2 sequence (Roberts 2018), shifted per pixel.
      const float px = Fraction(shift_x + 0.7548777f * static_cast<float>(s));
      const float py = Fraction(shift_y + 0.5698403f * static_cast<float>(s));
      // Points on the lamp: a sunflower, turned and jittered per pixel, begun anywhere so that place in the pixel and place on
      // the lamp do not go together.
      const int d = (first + s) % samples_;
      const float radius = std::sqrt((static_cast<float>(d) + UnitFloat(Fold(pixel, uint64_t(d)))) /
                                     static_cast<float>(samples_));
      const float angle =
          2 * std::numbers::pi_v<float> * Fraction(turn + 0.6180340f * static_cast<float>(d));
      array(13)[i] = radius * std::cos(angle);
      array(14)[i] = radius * std::sin(angle);

      const Vec3 direction = frame.forward + ((x + px) / width_ * 2 - 1) * tan_x * frame.right +
                             ((y + py) / height_ * 2 - 1) * tan_y * frame.down;
      Scene::Hit hit;
      if (!scene.Intersect(origin, direction.cast<float>(), &hit)) continue;
      const Vec3f start = hit.point + kLift * hit.face;
      for (int c = 0; c < 3; ++c) {
        array(c)[i] = start[c];
        array(3 + c)[i] = hit.normal[c];
        array(6 + c)[i] = hit.diffuse[c];
        array(9 + c)[i] = hit.material->specular[c];
      }
      array(12)[i] = hit.material->roughness;
    }
  }
}

}  // namespace lightstage::sim
