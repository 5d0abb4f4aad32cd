// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "agent/detect/frame/spot_finder.h"
#include "agent/identify/wand_verifier.h"

namespace rigcal::agent {

// Searches single images for the wand: spots of its colour at several levels, sets of them that can
// be the target's markers, and the best of these sets by what is measured.
//
// The pixels that a search reads and the poses that it fits are bounded by number, not by a clock,
// so the result is the same on every computer. Movable; one thread at a time.
class WandSearch {
 public:
  // Limits, target and camera must be valid. `washed_out_min`: see ColourRange.
  WandSearch(const WandLimits& limits, int washed_out_min, const WandMechanisms& without,
             const Target& target, const CameraDescription& camera, SpotFinder spot_finder);

  SpotFinder& spot_finder() { return spot_finder_; }
  const WandFinder& wand_finder() const { return wand_finder_; }
  // See WandVerifier::Record.
  void Record(std::vector<WandTrial>* trials) { verifier_.Record(trials); }

  // Call before the first search of an image.
  void StartImage();
  // Searches the whole image.
  Verdict SearchAll(const ImageView& image);
  // Searches a part of it at the last search's level. Takes only whole wands inside of the part.
  std::optional<VerifiedWand> SearchPart(const ImageView& image, const PixelRect& part);

  // Results for the current image.
  bool cut_short() const { return cut_short_; }          // something was left out for its cost
  double passed_share() const { return passed_share_; }  // see Detection
  double white_share() const { return white_share_; }
  int dismissed() const { return spot_finder_.dismissed(); }
  // Of the last search; valid until the next one.
  PixelRect window() const { return window_; }
  const BlobResult& result() const { return spot_finder_.result(); }

 private:
  bool IsLit(const ImageView& image);
  // Returns the levels in the order in which they are searched.
  std::vector<size_t> LevelsFor(const ImageView& image);
  // Sets candidates_ to those that are to be measured, the likeliest first.
  void FindCandidates();
  // Tells whether what was left out may be as good as the wand.
  bool MayHaveRivals(const Verdict& verdict) const;
  Verdict Search(const ImageView& image, const PixelRect& part, size_t level);

  int washed_out_min_;
  WandMechanisms without_;
  WandFinder wand_finder_;
  WandVerifier verifier_;
  PixelRect window_;
  SpotFinder spot_finder_;
  std::vector<Blob> standing_out_;      // blobs of the spots
  std::vector<Eigen::Vector3f> cores_;  // middles of the spots
  std::vector<double> doubts_;          // doubts of the spots
  std::vector<WandCandidate> candidates_;
  // What is left for the current image: poses to fit, and pixels to read for measurements.
  int fits_left_ = 0;
  double pixels_left_ = 0;
  bool cut_short_ = false;
  double passed_share_ = 0, white_share_ = 0;
  std::optional<bool> is_lit_;  // not a dark room; none: not looked at yet
};

}  // namespace rigcal::agent
