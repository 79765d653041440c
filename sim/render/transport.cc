#include "sim/render/transport.h"

#include <algorithm>
#include <cassert>
#include <limits>

#include "absl/strings/str_cat.h"
#include "sim/render/environment_light.h"

namespace lightstage::sim {

Transport::Transport(Scene scene, const RigGeometry& geometry, const TransportOptions& options)
    : scene_(std::move(scene)),
      geometry_(geometry),
      options_(options),
      parts_(geometry, options.parts) {}

PathOptions Transport::OptionsOfPaths() const {
  // What shines is as far out as the lamps or, if it can be met, the projector's lens.
  double clear = std::numeric_limits<double>::infinity();
  if (!geometry_.brace.lamps.empty()) clear = geometry_.brace.radius.meters();
  if (options_.lens.radius > Meters(0)) {
    clear = std::min(clear, geometry_.projector.distance.meters());
  }
  return {.samples = options_.samples,
          .bounces = options_.bounces,
          .seed = options_.seed,
          .clear_radius = static_cast<float>(clear - 1e-3)};
}

absl::Status Transport::CheckOutside(const Pose& pose, int lamp) const {
  if (lamp < 0) {
    const Vec3 at =
        geometry_.projector.distance.meters() * ProjectorDirection(geometry_.projector, pose);
    return scene_.CheckOutside(at.cast<float>(), "the projector");
  }
  const Vec3 at =
      geometry_.brace.radius.meters() * LampDirection(geometry_.brace.lamps[lamp], pose.azimuth);
  return scene_.CheckOutside(at.cast<float>(), absl::StrCat("lamp ", lamp));
}

size_t Transport::EstimatePathBytes(FilmSize size) const {
  return sim::EstimatePathBytes(scene_, geometry_.camera, size.width, size.height,
                                OptionsOfPaths());
}

std::shared_ptr<const Paths> Transport::GetPaths(FilmSize size) {
  MutexLock lock(&paths_mutex_);
  constexpr size_t kMost = 4;  // a camera has one size, a second camera another
  if (paths_.size() >= kMost && !paths_.contains(size)) paths_.clear();
  std::shared_ptr<const Paths>& paths = paths_[size];
  if (paths == nullptr) {
    paths = std::make_shared<Paths>(scene_, geometry_.camera, size.width, size.height,
                                    OptionsOfPaths());
  }
  return paths;
}

std::shared_ptr<const Image> Transport::Lamp(FilmSize size, const Pose& pose, int lamp, Keep keep) {
  assert(lamp >= 0 && lamp < static_cast<int>(geometry_.brace.lamps.size()));
  const Pose wrapped{WrapTurn(pose.azimuth), parts_.gantry() ? pose.tilt : Angle()};
  const Key key{size, lamp, wrapped.azimuth.degrees(), wrapped.tilt.degrees()};
  Value value;
  if (Find(key, &value)) return std::get<std::shared_ptr<const Image>>(value);
  const DiscLight light = LampLight(geometry_.brace, lamp, wrapped.azimuth,
                                    options_.lamp_intensity_w_sr, options_.seed);
  auto image = std::make_shared<const Image>(
      Illuminate(scene_, *GetPaths(size), light, parts_.At(wrapped).get()));
  Store(key, image, image->pixels().size_bytes(), keep);
  return image;
}

std::shared_ptr<const Image> Transport::Ambient(FilmSize size) {
  const Key key{size, kAmbient, 0, 0};
  Value value;
  if (Find(key, &value)) return std::get<std::shared_ptr<const Image>>(value);
  const EnvironmentLight light(*EnvironmentMap::FromImage(Image(2, 1, 1, 1.0f)), Angle());
  auto image = std::make_shared<const Image>(Illuminate(scene_, *GetPaths(size), light));
  Store(key, image, image->pixels().size_bytes(), Keep::kYes);
  return image;
}

std::shared_ptr<const ProjectorTransport> Transport::Projector(FilmSize size, const Pose& pose,
                                                               Keep keep) {
  assert(geometry_.projector.present);
  const Pose wrapped{WrapTurn(pose.azimuth), pose.tilt};
  const Key key{size, kProjector, wrapped.azimuth.degrees(), wrapped.tilt.degrees()};
  Value value;
  if (Find(key, &value)) return std::get<std::shared_ptr<const ProjectorTransport>>(value);
  const LensLight light = ProjectorLight(geometry_.projector, options_.lens, wrapped,
                                         options_.projector_intensity_w_sr, options_.seed);
  auto traced = std::make_shared<const ProjectorTransport>(
      Illuminate(scene_, *GetPaths(size), light, parts_.At(wrapped).get()));
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
