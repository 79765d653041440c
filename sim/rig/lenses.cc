#include "sim/rig/lenses.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

// 1 in the middle, 1 − lost in the corner: a parabola, as cos⁴ is to second order.
class Falloff {
 public:
  Falloff(double lost, int width, int height)
      : lost_(static_cast<float>(lost)),
        x_(static_cast<float>(width) / 2),
        y_(static_cast<float>(height) / 2),
        scale_(1 / (x_ * x_ + y_ * y_)) {}
  float At(int x, int y) const {
    const float dx = static_cast<float>(x) + 0.5f - x_, dy = static_cast<float>(y) + 0.5f - y_;
    return 1 - lost_ * scale_ * (dx * dx + dy * dy);
  }

 private:
  const float lost_, x_, y_, scale_;
};

// The weights of a Gaussian at whole pixels, up to 4 σ on either side; they add up to 1.
std::vector<float> Gaussian(double sigma) {
  const int reach = static_cast<int>(std::ceil(4 * sigma));
  std::vector<float> weights(2 * reach + 1);
  double sum = 0;
  for (int i = -reach; i <= reach; ++i) sum += std::exp(-0.5 * i * i / (sigma * sigma));
  for (int i = -reach; i <= reach; ++i) {
    weights[i + reach] = static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma)) / sum);
  }
  return weights;
}

// Along x or y; beyond the edge the light is as at the edge.
Image Spread(const Image& in, const std::vector<float>& weights, bool along_x) {
  const int reach = static_cast<int>(weights.size() / 2);
  Image out(in.width(), in.height(), in.channels());
  ForAll(in.height(), [&](int y) {
    for (int x = 0; x < in.width(); ++x) {
      for (int c = 0; c < in.channels(); ++c) {
        float sum = 0;
        for (int k = -reach; k <= reach; ++k) {
          const int px = along_x ? std::clamp(x + k, 0, in.width() - 1) : x;
          const int py = along_x ? y : std::clamp(y + k, 0, in.height() - 1);
          sum += weights[k + reach] * in.at(px, py, c);
        }
        out.at(x, y, c) = sum;
      }
    }
  });
  return out;
}

}  // namespace

Image Emitted(Image raster, const ProjectorOptics& optics) {
  if (optics.gamma == 1 && optics.black == 0 && optics.vignetting == 0) return raster;
  const Falloff falloff(optics.vignetting, raster.width(), raster.height());
  const auto black = static_cast<float>(optics.black), gamma = static_cast<float>(optics.gamma);
  ForAll(raster.height(), [&](int y) {
    for (int x = 0; x < raster.width(); ++x) {
      const float v = raster.at(x, y, 0);
      const float shown = v == 0 || v == 1 ? v : std::pow(v, gamma);
      raster.at(x, y, 0) = falloff.At(x, y) * (black + (1 - black) * shown);
    }
  });
  return raster;
}

void PassLens(const CameraLens& lens, Image* image) {
  if (lens.vignetting > 0) {
    const Falloff falloff(lens.vignetting, image->width(), image->height());
    ForAll(image->height(), [&](int y) {
      for (int x = 0; x < image->width(); ++x) {
        for (int c = 0; c < image->channels(); ++c) image->at(x, y, c) *= falloff.At(x, y);
      }
    });
  }
  if (lens.blur_px > 0) {
    const std::vector<float> weights = Gaussian(lens.blur_px);
    *image = Spread(Spread(*image, weights, true), weights, false);
  }
}

}  // namespace lightstage::sim
