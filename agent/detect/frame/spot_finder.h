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

// A blob of the wand's colour, or a piece of one, that differs from its surroundings.
struct Spot {
  Blob blob;
  Eigen::Vector3f core;  // mean grey levels of its middle, by channel
  bool is_cut;           // the window's edge may have cut it
  double doubt = 0;      // chi-squared against its being a sphere
};

// Finds the spots of an image: round blobs, and discs in larger patches and in pieces of them. The
// caller chooses one of several levels, ranges of the colour from wide to pale: the light of a room
// or a window whitens the spheres, and white things hide them. The cost of an image is bounded; the
// largest patches are left out first. Movable; one thread at a time.
class SpotFinder {
 public:
  // The colour as configured, which takes white; and paler ones, which do not.
  static constexpr size_t kWideLevel = 0, kPaleLevels[] = {1, 2};

  // Fails with INVALID_ARGUMENT if the options are not valid.
  static absl::StatusOr<SpotFinder> Create(const BlobFinderOptions& options);

  // Sets pixels, in a mask of the images' size, that never belong to a marker.
  void SetIgnored(const PixelMask& ignored);
  // Also ignores this background while pixels look like it (BlobFinder::SetBackground).
  void SetBackground(StaticBackground* background);

  // Starts an image with its whole budget.
  void BeginImage();
  // Finds the blobs of the widest level in the whole image.
  const BlobResult& Look(const ImageView& image);
  // Finds the spots of a level in a part of the image.
  void Find(const ImageView& image, const PixelRect& part, size_t level);

  // The spots of the last Find; if they were too many, those of least doubt, and not `has_all`.
  const std::vector<Spot>& spots() const { return spots_; }
  bool has_all() const { return std::isinf(least_doubt_left_); }
  // The least doubt of the spots that were left out.
  double least_doubt_left() const { return least_doubt_left_; }
  size_t level() const { return level_; }
  // The blobs of the last Find or Look.
  const BlobResult& result() const { return levels_[level_].blobs.result(); }

  // Patches of the image that were left out for their cost.
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
  int main_channel_;  // the strongest one of the wand's colour in a pixel
  DiscFinder discs_;
  std::vector<Spot> spots_;  // of the last Find
  double least_doubt_left_ = std::numeric_limits<double>::infinity();
  bool looked_ = false;  // at the current image
  BrightWords bright_;   // of it in the widest level, if looked_
  int64_t split_px_left_ = 0;
  int dismissed_ = 0;
};

}  // namespace rigcal::agent
