// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/blob_shape.h"
#include "agent/detect/blobs/disc_finder.h"

namespace rigcal::agent {

// A blob of the wand's colour, or a piece of one, that differs from what is around it: it may be a
// marker.
struct Spot {
  Blob blob;
  Eigen::Vector3f core;  // mean of its middle, by channel
  bool is_cut;           // the window may have cut it
  double doubt = 0;      // that it is a sphere, as a chi-squared
};

// Finds the spots of an image: round blobs, discs within larger patches and their pieces. In
// several levels, ranges of the colour from wide to narrow and pale, which the caller chooses from:
// light of a room or of a window whitens the spheres, and what is white hides them. What an image
// may cost is bounded; the largest patches are left out first. Movable; one thread at a time.
class SpotFinder {
 public:
  // As configured, which takes white; and paler ones, which do not.
  static constexpr size_t kWideLevel = 0, kPaleLevels[] = {1, 2};

  // INVALID_ARGUMENT: options not valid.
  static absl::StatusOr<SpotFinder> Create(const BlobFinderOptions& options);

  // Pixels that never belong to a marker from now on, of the images' size.
  void SetIgnored(const PixelMask& ignored);
  // Nor those of this background, while they look like it (BlobFinder::SetBackground).
  void SetBackground(StaticBackground* background);

  // Before the first search of an image: its whole budget is left.
  void BeginImage();
  // Blobs of the widest level in the whole image.
  const BlobResult& Look(const ImageView& image);
  // Spots of a level, in a part of the image.
  void Find(const ImageView& image, const PixelRect& part, size_t level);

  // Of the last Find. Of too many spots those of least doubt: not `has_all`.
  const std::vector<Spot>& spots() const { return spots_; }
  bool has_all() const { return std::isinf(least_doubt_left_); }
  // Of the spots that were left out.
  double least_doubt_left() const { return least_doubt_left_; }
  size_t level() const { return level_; }
  // Blobs of the last Find, or Look.
  const BlobResult& result() const { return levels_[level_].blobs.result(); }

  // Of the image: patches left out for their cost.
  int dismissed() const { return dismissed_; }

 private:
  struct Level {
    BlobFinder blobs;
    ColourMasker masker;
  };

  explicit SpotFinder(const BlobFinderOptions& options);
  bool HasColour(const ImageView& image, const Blob& blob) const;
  void Keep(const ImageView& image, const Blob& blob, bool is_cut);

  std::vector<Level> levels_;
  size_t level_ = 0;
  int min_area_px_;
  int main_channel_;  // of the wand's colour, in an image's pixel
  DiscFinder discs_;
  std::vector<Spot> spots_;  // of this level
  double least_doubt_left_ = std::numeric_limits<double>::infinity();
  bool looked_ = false;  // at this image
  BrightWords bright_;   // of it, if so, in the widest level
  int64_t split_px_left_ = 0;
  int dismissed_ = 0;
};

}  // namespace rigcal::agent
