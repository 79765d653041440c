// A finished capture, opened for reading (docs/DATASET.md).
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "base/env.h"
#include "dataset/basis_image.h"
#include "dataset/manifest.h"
#include "dataset/shot.h"

namespace lightstage::relight {

class Dataset {
 public:
  // Opens a run's folder. NOT_FOUND / DATASET_NOT_FOUND if it has no manifest; DATA_LOSS / MANIFEST_CORRUPT; FAILED_PRECONDITION /
  // DATASET_EMPTY if it has no basis image; errors of Read() for the first one's header. `env` must outlive the dataset.
  static absl::StatusOr<Dataset> Open(const std::string& folder, Env& env = PosixEnv());

  const Manifest& manifest() const { return manifest_; }
  // The basis images alone, by shot id; dark and reference frames are left out.
  const std::vector<ShotRecord>& basis() const { return basis_; }

  // Reads one image. Errors name the file: as ReadBasisExr, and DATA_LOSS / DATASET_INCONSISTENT if its size or channels are not the
  // manifest's. Thread-safe.
  absl::StatusOr<BasisImage> Read(const ShotRecord& record) const;

 private:
  Dataset() = default;
  std::string folder_;
  Env* env_ = nullptr;
  Manifest manifest_;
  std::vector<ShotRecord> basis_;
};

}  // namespace lightstage::relight
