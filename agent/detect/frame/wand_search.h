// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "absl/types/span.h"
#include "agent/detect/frame/search_budget.h"
#include "agent/detect/frame/spot_finder.h"
#include "agent/identify/wand_verifier.h"

namespace rigcal::agent {

// Searches single images for the wand: spots of its colour in levels of brightness and saturation,
// sets of them that can be the target's markers, the best of them by what is measured. Wands of
// which a marker is hidden are looked for where no whole one is found.
//
// Its time is bounded, by what was done and not by a clock, so that the result is the same on every
// computer. Movable; one thread at a time.
class WandSearch {
 public:
  // Options, target and camera must be valid. `washed_out_min`: see ColourRange. `may_be_dim`: the
  // exposure may have caught a part of the spheres' light only.
  WandSearch(const WandLimits& limits, int washed_out_min, bool may_be_dim,
             const WandMechanisms& without, const Target& target, const CameraDescription& camera,
             SpotFinder spot_finder);

  SpotFinder& spot_finder() { return spot_finder_; }
  const WandFinder& wand_finder() const { return wand_finder_; }

  // Before the first search of an image.
  void StartImage();
  // In the whole image.
  Verdict SearchAll(const ImageView& image);
  // In a part of it, at the level of the last search: whole wands that the part's edges do not cut.
  std::optional<VerifiedWand> SearchPart(const ImageView& image, const PixelRect& part);

  // Of this image.
  bool cut_short() const { return cut_short_; }          // something was left out for the time
  double passed_share() const { return passed_share_; }  // see Detection
  double white_share() const { return white_share_; }
  int dismissed() const { return spot_finder_.dismissed(); }
  // Of the last search; valid until the next one.
  PixelRect window() const { return window_; }
  const BlobResult& result() const { return spot_finder_.result(); }

 private:
  double ShareOf(int64_t count_px) const;
  bool IsCrowded() const;
  bool IsLit(const ImageView& image);
  double EstimatedMs() const;
  bool IsSure(const VerifiedWand& wand) const;
  Verdict VerifyFound(const ImageView& image, double most_work);
  // `only_if_few`: see SpotFinder::Find.
  Verdict Search(const ImageView& image, const PixelRect& part, size_t level,
                 bool only_if_few = false);
  Verdict SearchPartial(const ImageView& image, absl::Span<const Spot> spots, double kept_work,
                        bool look_for_third = false);
  Verdict SearchThird(const ImageView& image, absl::Span<const WandCandidate> thirds,
                      int places_tried);
  void TryWhole(const ImageView& image, VerifiedWand* wand);
  Verdict SearchLevels(const ImageView& image, std::optional<VerifiedWand>* of_parts);

  int washed_out_min_;
  bool may_be_dim_;
  WandMechanisms without_;
  ImageSize image_size_px_;
  WandFinder wand_finder_;
  WandVerifier verifier_;
  PixelRect window_;
  SpotFinder spot_finder_;
  std::vector<Blob> standing_out_;      // the spots' blobs
  std::vector<Eigen::Vector3f> cores_;  // their middles
  std::vector<double> doubts_;          // and doubts
  std::vector<WandCandidate> candidates_;
  // Of this image: what its search may still cost, and whether anything was left out for that.
  SearchBudget budget_;
  bool cut_short_ = false;
  int tried_ = 0;  // sets of spots, among which some fit by chance
  // Of all its searches: with a marker that is not whole, which only evidence makes a wand.
  std::optional<VerifiedWand> by_evidence_;
  std::vector<Spot> contrast_spots_;  // of the level of contrast, where they make no wand
  bool parts_left_ = false;           // the last Search looked for whole wands only
  bool has_rivals_ = false;           // the last Search measured two wands that are equally good
  double passed_share_ = 0, white_share_ = 0;
  std::optional<bool> is_lit_;  // more than a dark room's spots; none: not looked at yet
};

}  // namespace rigcal::agent
