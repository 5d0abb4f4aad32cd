// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "agent/detect/frame/spot_finder.h"
#include "agent/identify/wand_verifier.h"

namespace rigcal::agent {

// Searches single images for the wand: spots of its colour in levels of brightness and saturation,
// sets of them that can be the target's markers, the best of them by what is measured.
//
// What a search may cost is bounded by the pixels that it reads and the poses that it fits, not by
// a clock, so that the result is the same on every computer. Movable; one thread at a time.
class WandSearch {
 public:
  // Options, target and camera must be valid. `washed_out_min`: see ColourRange.
  WandSearch(const WandLimits& limits, int washed_out_min, const WandMechanisms& without,
             const Target& target, const CameraDescription& camera, SpotFinder spot_finder);

  SpotFinder& spot_finder() { return spot_finder_; }
  const WandFinder& wand_finder() const { return wand_finder_; }
  // See WandVerifier.
  void Record(std::vector<WandTrial>* trials) { verifier_.Record(trials); }

  // Before the first search of an image.
  void StartImage();
  // In the whole image.
  Verdict SearchAll(const ImageView& image);
  // In a part of it, at the level of the last search: wands that the part's edges do not cut.
  std::optional<VerifiedWand> SearchPart(const ImageView& image, const PixelRect& part);

  // Of this image.
  bool cut_short() const { return cut_short_; }          // something was left out for its cost
  double passed_share() const { return passed_share_; }  // see Detection
  double white_share() const { return white_share_; }
  int dismissed() const { return spot_finder_.dismissed(); }
  // Of the last search; valid until the next one.
  PixelRect window() const { return window_; }
  const BlobResult& result() const { return spot_finder_.result(); }

 private:
  bool IsLit(const ImageView& image);
  // In the order in which they are searched.
  std::vector<size_t> LevelsFor(const ImageView& image);
  // Sets candidates_ to those that are measured, the likeliest first.
  void FindCandidates();
  // What was left out may be as good.
  bool MayHaveRivals(const Verdict& verdict) const;
  Verdict Search(const ImageView& image, const PixelRect& part, size_t level);

  int washed_out_min_;
  WandMechanisms without_;
  WandFinder wand_finder_;
  WandVerifier verifier_;
  PixelRect window_;
  SpotFinder spot_finder_;
  std::vector<Blob> standing_out_;      // the spots' blobs
  std::vector<Eigen::Vector3f> cores_;  // their middles
  std::vector<double> doubts_;          // and doubts
  std::vector<WandCandidate> candidates_;
  // Of this image: poses that may still be fitted, and pixels that may still be read to measure.
  int fits_left_ = 0;
  double pixels_left_ = 0;
  bool cut_short_ = false;
  double passed_share_ = 0, white_share_ = 0;
  std::optional<bool> is_lit_;  // more than a dark room's spots; none: not looked at yet
};

}  // namespace rigcal::agent
