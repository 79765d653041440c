// How light gets from each lamp, or each pixel of the projector, to each pixel of the camera. Transport, not pictures, is kept:
// what a pose costs to trace is traced once, and any lamp level or pattern is then a product. Light adds, so all pictures made
// of one transport are exactly consistent with each other.
//
// Thread-safe. The same seed gives the same bytes, however many threads trace and in whatever order things are asked for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/status.h"
#include "base/mutex.h"
#include "optics/image.h"
#include "optics/rig_geometry.h"
#include "sim/render/illuminate.h"
#include "sim/render/paths.h"
#include "sim/render/rig_parts.h"
#include "sim/render/scene.h"

namespace lightstage::sim {

struct TransportOptions {
  uint64_t seed = 1;
  int samples = 8;                         // paths per camera pixel, [1, 65536]
  int bounces = 0;                         // between surfaces (paths.h); 0: direct light only
  size_t cache_bytes = size_t{512} << 20;  // for transport; the camera's paths come on top
  double lamp_intensity_w_sr = 10;         // each lamp at level 1, along its axis; Lambertian
  double projector_intensity_w_sr = 10;    // along its axis, at pattern value 1
  LensOptions lens;                        // the projector's
  PartOptions
      parts;  // of the rig, that stand in the light; the camera's body is for the scene to have
};

struct FilmSize {
  int width = 0, height = 0;
  auto operator<=>(const FilmSize&) const = default;
};

// Whether to keep what was traced for the next time.
enum class Keep { kYes, kNo };

class Transport {
 public:
  Transport(Scene scene, const RigGeometry& geometry, const TransportOptions& options);

  const RigGeometry& geometry() const { return geometry_; }

  // Radiance, W/(m²·sr), 3 channels, under one lamp at level 1. The tilt matters only if a gantry stands in the light.
  std::shared_ptr<const Image> Lamp(FilmSize size, const Pose& pose, int lamp, Keep keep);
  // Under light of radiance 1 from all around.
  std::shared_ptr<const Image> Ambient(FilmSize size);
  // The rig must have a projector.
  std::shared_ptr<const ProjectorTransport> Projector(FilmSize size, const Pose& pose, Keep keep);

  // About how many bytes the paths of a picture of this size take.
  size_t EstimatePathBytes(FilmSize size) const;

  // INSIDE_OBJECT if this lamp, or the projector if it is < 0, stands inside of the object at this pose: it would light it from within.
  absl::Status CheckOutside(const Pose& pose, int lamp) const;

  // Bytes of kept transport, at most cache_bytes (one entry larger than that is not kept).
  size_t cached_bytes() const;
  // Transports traced so far; a kept one that was used again does not count.
  uint64_t traced() const;

 private:
  // Lamp ≥ 0, kProjector or kAmbient. Azimuths are wrapped, so that a turn later is the same pose.
  static constexpr int kProjector = -1, kAmbient = -2;
  struct Key {
    FilmSize size;
    int lamp;
    double azimuth_deg, tilt_deg;
    auto operator<=>(const Key&) const = default;
  };
  // shared: a frame being made may outlive an entry's place in the cache.
  using Value =
      std::variant<std::shared_ptr<const Image>, std::shared_ptr<const ProjectorTransport>>;
  struct Entry {
    Key key;
    Value value;
    size_t bytes;
  };

  PathOptions OptionsOfPaths() const;
  std::shared_ptr<const Paths> GetPaths(FilmSize size);
  bool Find(const Key& key, Value* value);
  void Store(const Key& key, Value value, size_t bytes, Keep keep);

  const Scene scene_;
  const RigGeometry geometry_;
  const TransportOptions options_;
  const RigParts parts_;

  Mutex paths_mutex_;  // held while paths are traced, so that nobody traces them twice
  std::map<FilmSize, std::shared_ptr<const Paths>> paths_ ABSL_GUARDED_BY(paths_mutex_);

  mutable Mutex mutex_;
  std::list<Entry> entries_ ABSL_GUARDED_BY(mutex_);  // most recently used first
  std::map<Key, std::list<Entry>::iterator> index_ ABSL_GUARDED_BY(mutex_);
  size_t bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  uint64_t traced_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace lightstage::sim
