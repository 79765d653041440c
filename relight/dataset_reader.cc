#include "relight/dataset_reader.h"

#include <utility>

#include "base/status.h"
#include "dataset/basis_exr.h"

namespace lightstage::relight {
namespace {

absl::Status CheckShape(const std::string& path, int width, int height, int channels,
                        const Manifest& m) {
  if (width == m.width && height == m.height && channels == m.channels) return absl::OkStatus();
  auto shape = [](int w, int h, int c) {
    return absl::StrCat(w, "×", h, " with ", c, " channels");
  };
  const std::string is = shape(width, height, channels);
  const std::string should = shape(m.width, m.height, m.channels);
  return Error(absl::StatusCode::kDataLoss, "DATASET_INCONSISTENT",
               absl::StrCat(path, " is ", is, "; the manifest says ", should),
               {{"file", path}, {"is", is}, {"manifest", should}});
}

}  // namespace

absl::StatusOr<Dataset> Dataset::Open(const std::string& folder, Env& env) {
  const std::string manifest_path = absl::StrCat(folder, "/", kManifestFile);
  if (!env.Exists(manifest_path)) {
    return Error(absl::StatusCode::kNotFound, "DATASET_NOT_FOUND",
                 absl::StrCat("'", folder, "' has no ", kManifestFile,
                              ": give the folder of a finished run"),
                 {{"folder", folder}});
  }
  Dataset dataset;
  dataset.folder_ = folder;
  dataset.env_ = &env;
  ASSIGN_OR_RETURN(dataset.manifest_, ReadManifest(folder, env));
  for (const ShotRecord& record : dataset.manifest_.shots) {
    if (record.shot.kind == ShotKind::kBasis) dataset.basis_.push_back(record);
  }
  if (dataset.basis_.empty()) {
    return Error(absl::StatusCode::kFailedPrecondition, "DATASET_EMPTY",
                 absl::StrCat("'", folder, "' has no basis image"), {{"folder", folder}});
  }
  // One image is looked at now, before anyone allocates what the manifest says.
  const std::string first = absl::StrCat(folder, "/", dataset.basis_.front().file);
  ASSIGN_OR_RETURN(std::string bytes, env.ReadFile(first));
  ASSIGN_OR_RETURN(BasisHeader header, ReadBasisHeader(bytes, first));
  RETURN_IF_ERROR(
      CheckShape(first, header.width, header.height, header.channels, dataset.manifest_));
  return dataset;
}

absl::StatusOr<BasisImage> Dataset::Read(const ShotRecord& record) const {
  const std::string path = absl::StrCat(folder_, "/", record.file);
  ASSIGN_OR_RETURN(DecodedBasis decoded, ReadBasisExr(path, *env_));
  const Image& image = decoded.image.pixels;
  RETURN_IF_ERROR(CheckShape(path, image.width(), image.height(), image.channels(), manifest_));
  return std::move(decoded.image);
}

}  // namespace lightstage::relight
