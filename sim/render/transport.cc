#include "sim/render/transport.h"

#include <cassert>
#include <limits>

namespace lightstage::sim {
// ---- Transport

Transport::Transport(Scene scene, const RigGeometry& geometry, const TransportOptions& options)
    : scene_(std::move(scene)), geometry_(geometry), options_(options) {}

std::shared_ptr<const Paths> Transport::GetPaths(FilmSize size) {
  MutexLock lock(&paths_mutex_);
  constexpr size_t kMost = 4;  // a camera has one size, a second camera another
  if (paths_.size() >= kMost && !paths_.contains(size)) paths_.clear();
  std::shared_ptr<const Paths>& paths = paths_[size];
  if (paths == nullptr) {
    PathOptions options{
        .samples = options_.samples, .bounces = options_.bounces, .seed = options_.seed};
    const BraceGeometry& brace = geometry_.brace;
    double clear =
        brace.lamps.empty() ? std::numeric_limits<double>::infinity() : brace.radius.meters();
    options.clear_radius = static_cast<float>(clear - 1e-3);
    paths = std::make_shared<Paths>(scene_, geometry_.camera, size.width, size.height, options);
  }
  return paths;
}

std::shared_ptr<const Image> Transport::Lamp(FilmSize size, Angle azimuth, int lamp, Keep keep) {
  assert(lamp >= 0 && lamp < static_cast<int>(geometry_.brace.lamps.size()));
  azimuth = WrapTurn(azimuth);
  const Key key{size, lamp, azimuth.degrees(), 0};
  Value value;
  if (Find(key, &value)) return std::get<std::shared_ptr<const Image>>(value);
  auto image = std::make_shared<const Image>(Illuminate(
      scene_, *GetPaths(size),
      LampLight(geometry_.brace, lamp, azimuth, options_.lamp_intensity_w_sr, options_.seed)));
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
  auto traced = std::make_shared<const ProjectorTransport>(
      Illuminate(scene_, *GetPaths(size),
                 ProjectorLight(geometry_.projector, wrapped, options_.projector_intensity_w_sr)));
  Store(key, traced, traced->bytes(), keep);
  return traced;
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
