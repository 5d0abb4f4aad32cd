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
#include "agent/detect/blobs/blob_splitter.h"
#include "agent/detect/blobs/contrast_masker.h"
#include "agent/detect/blobs/disc_finder.h"
#include "agent/identify/wand_mechanisms.h"

namespace rigcal::agent {

// A blob of the wand's colour, or a piece of one, that differs from what is around it: it may be a
// marker.
struct Spot {
  Blob blob;
  Eigen::Vector3f core;  // mean of its middle, by channel
  bool is_cut;           // the window may have cut it
  double doubt = 0;      // that it is a sphere, as a chi-squared
  // Of a blob that may be two discs: which blob it is a half of, and whether it is a marker only
  // together with the other half. -1: none.
  int pair = -1;
  bool is_half = false;
};

// Two discs of one blob are markers of a wand together or not at all.
bool HasOtherHalves(absl::Span<const Spot> spots, absl::Span<const int> chosen);

// Finds the spots of an image: round blobs, discs within larger patches and their pieces. In
// several levels, ranges of the colour from wide to narrow and pale, which the caller chooses from:
// light of a room or of a window whitens the spheres, and what is white hides them. What an image
// may cost is bounded; the largest patches are left out first. Movable; one thread at a time.
class SpotFinder {
 public:
  // Levels from some brightness on, which take white; and paler ones, which do not.
  static constexpr size_t kWideLevels[] = {0, 1, 2, 3}, kPaleLevels[] = {4, 5};
  // Of spheres so bright that two channels are clipped, which turns red to yellow.
  static constexpr size_t kClippedLevel = 6;
  // Of spheres that white light has made brighter in all channels than what is behind them, which
  // is of their hue and has more colour.
  static constexpr size_t kWhitenedLevel = 7;
  // Of spheres half as bright as configured: an exposure that is shorter than a blink catches a
  // part of its light only.
  static constexpr size_t kDimLevel = 8;
  // Of spheres that have only more of their colour than what is around them.
  static constexpr size_t kContrastLevel = 9;

  // INVALID_ARGUMENT: options not valid.
  static absl::StatusOr<SpotFinder> Create(const BlobFinderOptions& options,
                                           const WandMechanisms& without = {});

  // Pixels that never belong to a marker from now on, of the images' size.
  void SetIgnored(const PixelMask& ignored);
  // Nor those of this background, while they look like it (BlobFinder::SetBackground).
  void SetBackground(StaticBackground* background);

  // Before the first search of an image: its whole budget is left.
  void BeginImage();
  // Blobs of the widest level in the whole image.
  const BlobResult& Look(const ImageView& image);
  // Spots of a level, in a part of the image; by contrast in the whole image those of the level
  // before, too: of a wand one sphere may stand out by its colour only, and another one by nothing
  // else. `only_if_few`: none, where there are more blobs than can be looked at.
  void Find(const ImageView& image, const PixelRect& part, size_t level, bool only_if_few = false);

  // Of the last Find. Of too many spots those of least doubt: not `has_all`.
  const std::vector<Spot>& spots() const { return spots_; }
  bool has_all() const { return std::isinf(least_doubt_left_); }
  // Of the spots that were left out.
  double least_doubt_left() const { return least_doubt_left_; }
  size_t level() const { return level_; }
  // By which a marker of that level differs from what is around it, over all channels.
  double min_contrast_grey() const { return ContrastGreyOf(level_); }
  static double ContrastGreyOf(size_t level);
  // Blobs of the last Find, or Look.
  const BlobResult& result() const { return levels_[level_].blobs.result(); }

  // Of the image: patches left out for their cost, and time by what was done, the same on every
  // computer.
  int dismissed() const { return dismissed_; }
  double EstimatedMs() const;

 private:
  struct Level {
    BlobFinder blobs;
    BlobFinder coloured;  // leaves out what the sensor has lost the colour of
    ColourMasker masker;
  };

  SpotFinder(const BlobFinderOptions& options, const WandMechanisms& without);
  bool HasColour(const ImageView& image, const Blob& blob) const;
  // `pair`: one of two discs that this blob may be.
  void Keep(const ImageView& image, const Blob& blob, bool is_cut, int pair = -1);
  void KeepPairs(const ImageView& image, const PixelRect& part);
  // What the level before has found, where this one has nothing that looks more like a sphere.
  void KeepOfLevelBefore(Spot spot);

  WandMechanisms without_;
  std::vector<Level> levels_;
  size_t level_ = 0;
  int min_area_px_;
  ColourRange colour_;
  int main_channel_;  // of the wand's colour, in an image's pixel
  BlobSplitter splitter_;
  DiscFinder discs_;
  ContrastMasker contrast_;
  std::vector<const Blob*> pairs_;          // what may be two spheres
  std::vector<Spot> spots_, spots_before_;  // of this level, and those kept of the one before
  double least_doubt_left_ = std::numeric_limits<double>::infinity();
  bool looked_ = false;           // at this image
  bool has_whole_image_ = false;  // spots_ are those of all of it
  BrightWords bright_;            // of it, if so, in the widest level
  int64_t masked_px_left_ = 0, split_px_left_ = 0;
  // In all levels: runs of pixels, searches of the whole image, blobs that were looked at, spots.
  int64_t runs_ = 0;
  int searches_ = 0, looked_at_ = 0, found_ = 0;
  int dismissed_ = 0;
};

}  // namespace rigcal::agent
