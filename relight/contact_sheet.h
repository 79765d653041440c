// A sheet of thumbnails of a capture's basis images, laid out by light direction.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "dataset/shot.h"
#include "optics/image.h"
#include "relight/dataset_reader.h"

namespace lightstage::relight {

struct SheetLayout {
  int columns = 0, rows = 0;
  std::vector<size_t> images;  // row by row, indices into the records; the last row may be shorter
  bool regular = false;        // columns are azimuths, rows are tilts
};

// Lays out at most max_columns × max_rows images. Where the directions form a full grid of azimuths × tilts, columns are azimuths ascending
// from 0° and rows tilts from the zenith down, evenly thinned to fit (64×20 becomes 32×10). Otherwise directions are ordered by tilt,
// thinned evenly, and each row ordered by azimuth. Of several images of one direction the brightest is shown. Without any direction, images
// stand in the order they were taken.
SheetLayout LayOut(const std::vector<ShotRecord>& basis, int max_columns = 32, int max_rows = 10);

// The sheet, linear, at one scale for all images. Thumbnails are at most `thumbnail_width` wide, averaged over whole pixels.
absl::StatusOr<Image> MakeContactSheet(const Dataset& dataset, const SheetLayout& layout,
                                       int thumbnail_width = 96);

}  // namespace lightstage::relight
