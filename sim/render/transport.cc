#include "sim/render/transport.h"

#include <cassert>
#include <cmath>
#include <numbers>
#include <span>

#include "sim/render/hash.h"
#include "sim/render/parallel.h"

namespace lightstage::sim {
namespace {

void Copy(const Vec3& from, float* to) {
  for (int c = 0; c < 3; ++c) to[c] = static_cast<float>(from[c]);
}

}  // namespace

// ---- ProjectorTransport

void ProjectorTransport::Add(const Image& raster, float scale, Image* sum) const {
  const std::span<const float> values = raster.pixels();
  ForRows(sum->height(), [&](int y) {
    std::span<float> row = sum->row(y);
    for (int x = 0; x < width_; ++x) {
      const size_t pixel = static_cast<size_t>(y) * width_ + x;
      float r = 0, g = 0, b = 0;
      for (uint32_t s = first_[pixel]; s < first_[pixel + 1]; ++s) {
        const float value = values[source_[s]];
        if (value == 0) continue;
        r += value * rgb_[3 * size_t{s}];
        g += value * rgb_[3 * size_t{s} + 1];
        b += value * rgb_[3 * size_t{s} + 2];
      }
      float* out = &row[3 * static_cast<size_t>(x)];
      out[0] += scale * r;
      out[1] += scale * g;
      out[2] += scale * b;
    }
  });
}

size_t ProjectorTransport::bytes() const {
  return sizeof(uint32_t) * (first_.capacity() + source_.capacity()) +
         sizeof(float) * rgb_.capacity();
}

// ---- Transport

Transport::Transport(Scene scene, const RigGeometry& geometry, const TransportOptions& options)
    : scene_(std::move(scene)), geometry_(geometry), options_(options) {}

std::shared_ptr<const Film> Transport::GetFilm(FilmSize size) {
  MutexLock lock(&film_mutex_);
  constexpr size_t kMaxFilms = 4;  // a camera has one size, a second camera another
  if (films_.size() >= kMaxFilms && !films_.contains(size)) films_.clear();
  std::shared_ptr<const Film>& film = films_[size];
  if (film == nullptr) {
    film = std::make_shared<Film>(scene_, geometry_.camera, size.width, size.height,
                                  options_.samples, options_.seed);
  }
  return film;
}

std::shared_ptr<const Image> Transport::Lamp(FilmSize size, Angle azimuth, int lamp, Keep keep) {
  assert(lamp >= 0 && lamp < static_cast<int>(geometry_.brace.lamps.size()));
  azimuth = WrapTurn(azimuth);
  const Key key{size, lamp, azimuth.degrees(), 0};
  Value value;
  if (Find(key, &value)) return std::get<std::shared_ptr<const Image>>(value);
  auto image = std::make_shared<const Image>(TraceLamp(*GetFilm(size), azimuth, lamp));
  Store(key, image, image->pixels().size_bytes(), keep);
  return image;
}

std::shared_ptr<const ProjectorTransport> Transport::Projector(FilmSize size, const Pose& pose,
                                                               Keep keep) {
  assert(geometry_.projector.present);
  const Pose wrapped{WrapTurn(pose.azimuth), pose.tilt};
  const Key key{size, -1, wrapped.azimuth.degrees(), wrapped.tilt.degrees()};
  Value value;
  if (Find(key, &value)) return std::get<std::shared_ptr<const ProjectorTransport>>(value);
  auto traced = std::make_shared<const ProjectorTransport>(TraceProjector(*GetFilm(size), wrapped));
  Store(key, traced, traced->bytes(), keep);
  return traced;
}

Image Transport::TraceLamp(const Film& film, Angle azimuth, int lamp) const {
  const BraceGeometry& brace = geometry_.brace;
  const Vec3 direction = LampDirection(brace.lamps[lamp], azimuth);
  // Every lamp and pose turns the samples' points on the disc its own way: their noise is independent.
  const uint64_t hash = Fold(Fold(options_.seed, static_cast<uint64_t>(lamp)), azimuth.degrees());
  const double turn = 2 * std::numbers::pi * UnitFloat(hash);
  const Vec3 across = direction.unitOrthogonal(), up = direction.cross(across);
  const double radius = brace.lamp_radius.meters();
  DiscLight light;
  Copy(brace.radius.meters() * direction, light.center);
  Copy(radius * (std::cos(turn) * across + std::sin(turn) * up), light.u);
  Copy(radius * (std::cos(turn) * up - std::sin(turn) * across), light.v);
  Copy(-direction, light.axis);
  light.intensity = static_cast<float>(options_.lamp_intensity_w_sr);

  Image image(film.width(), film.height(), 3);
  const int samples = film.samples();
  const float share = 1.0f / static_cast<float>(samples);
  ForRows(film.height(), [&](int y) {
    thread_local std::vector<float> buffer;
    const size_t stride = film.row_stride();
    buffer.resize(3 * stride);
    float *r = buffer.data(), *g = r + stride, *b = g + stride;
    BestKernels().disc(scene_.handle(), film.hits(), light, y * stride, (y + 1) * stride, r, g, b);
    std::span<float> row = image.row(y);
    for (int x = 0; x < film.width(); ++x) {
      float sum[3] = {0, 0, 0};
      for (int s = x * samples; s < (x + 1) * samples; ++s) {
        sum[0] += r[s];
        sum[1] += g[s];
        sum[2] += b[s];
      }
      for (int c = 0; c < 3; ++c) row[3 * x + c] = share * sum[c];
    }
  });
  return image;
}

ProjectorTransport Transport::TraceProjector(const Film& film, const Pose& pose) const {
  const ProjectorGeometry& projector = geometry_.projector;
  const ViewFrame frame = ProjectorFrame(projector, pose);
  PinholeLight light;
  Copy(frame.position, light.position);
  Copy(frame.right, light.right);
  Copy(frame.down, light.down);
  Copy(frame.forward, light.forward);
  light.tan_x = static_cast<float>(std::tan(projector.field_of_view.radians() / 2));
  light.tan_y =
      light.tan_x * static_cast<float>(projector.height) / static_cast<float>(projector.width);
  light.width = projector.width;
  light.height = projector.height;
  light.intensity = static_cast<float>(options_.projector_intensity_w_sr);

  const int width = film.width(), height = film.height(), samples = film.samples();
  const float share = 1.0f / static_cast<float>(samples);
  struct Row {
    std::vector<uint32_t> counts, source;
    std::vector<float> rgb;
  };
  std::vector<Row> rows(height);
  ForRows(height, [&](int y) {
    thread_local std::vector<float> buffer;
    thread_local std::vector<uint32_t> pixels;
    const size_t stride = film.row_stride();
    buffer.resize(3 * stride);
    pixels.resize(stride);
    float *r = buffer.data(), *g = r + stride, *b = g + stride;
    BestKernels().pinhole(scene_.handle(), film.hits(), light, y * stride, (y + 1) * stride,
                          pixels.data(), r, g, b);
    Row& row = rows[y];
    row.counts.resize(width);
    for (int x = 0; x < width; ++x) {
      for (int s = x * samples; s < (x + 1) * samples; ++s) {
        if (pixels[s] == kUnlit) continue;
        ++row.counts[x];
        row.source.push_back(pixels[s]);
        row.rgb.insert(row.rgb.end(), {share * r[s], share * g[s], share * b[s]});
      }
    }
  });

  ProjectorTransport out;
  out.width_ = width;
  size_t total = 0;
  for (const Row& row : rows) total += row.source.size();
  out.first_.reserve(static_cast<size_t>(width) * height + 1);
  out.source_.reserve(total);
  out.rgb_.reserve(3 * total);
  uint32_t at = 0;
  for (const Row& row : rows) {
    for (uint32_t count : row.counts) {
      out.first_.push_back(at);
      at += count;
    }
    out.source_.insert(out.source_.end(), row.source.begin(), row.source.end());
    out.rgb_.insert(out.rgb_.end(), row.rgb.begin(), row.rgb.end());
  }
  out.first_.push_back(at);
  return out;
}

bool Transport::Find(const Key& key, Value* value) {
  MutexLock lock(&mutex_);
  auto it = index_.find(key);
  if (it == index_.end()) return false;
  entries_.splice(entries_.begin(), entries_, it->second);
  *value = it->second->value;
  return true;
}

void Transport::Store(const Key& key, Value value, size_t bytes, Keep keep) {
  MutexLock lock(&mutex_);
  ++traced_;
  // Two threads may have traced the same; what they traced is equal.
  if (keep == Keep::kNo || bytes > options_.cache_bytes || index_.contains(key)) return;
  while (bytes_ + bytes > options_.cache_bytes) {
    bytes_ -= entries_.back().bytes;
    index_.erase(entries_.back().key);
    entries_.pop_back();
  }
  entries_.push_front({key, std::move(value), bytes});
  index_.emplace(key, entries_.begin());
  bytes_ += bytes;
}

size_t Transport::cached_bytes() const {
  MutexLock lock(&mutex_);
  return bytes_;
}

uint64_t Transport::traced() const {
  MutexLock lock(&mutex_);
  return traced_;
}

}  // namespace lightstage::sim
