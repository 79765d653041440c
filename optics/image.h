// A float image in memory: `channels` interleaved, row 0 on top. Linear, no colour management (primaries are the camera's own).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace lightstage {

class Image {
 public:
  Image() = default;
  Image(int width, int height, int channels, float fill = 0.0f)
      : width_(width),
        height_(height),
        channels_(channels),
        data_(static_cast<size_t>(width) * height * channels, fill) {}

  int width() const { return width_; }
  int height() const { return height_; }
  int channels() const { return channels_; }
  bool empty() const { return data_.empty(); }
  bool SameShape(const Image& o) const {
    return width_ == o.width_ && height_ == o.height_ && channels_ == o.channels_;
  }

  float& at(int x, int y, int c) { return data_[Index(x, y, c)]; }
  float at(int x, int y, int c) const { return data_[Index(x, y, c)]; }
  std::span<float> pixels() { return data_; }
  std::span<const float> pixels() const { return data_; }
  std::span<float> row(int y) {
    return pixels().subspan(Index(0, y, 0), size_t(width_) * channels_);
  }
  std::span<const float> row(int y) const {
    return pixels().subspan(Index(0, y, 0), size_t(width_) * channels_);
  }

 private:
  size_t Index(int x, int y, int c) const {
    return (static_cast<size_t>(y) * width_ + x) * channels_ + c;
  }
  int width_ = 0, height_ = 0, channels_ = 0;
  std::vector<float> data_;
};

}  // namespace lightstage
