// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "agent/identify/marker_centre.h"
#include "agent/identify/wand_finder.h"

namespace rigcal::agent {

// A wand whose markers were measured.
struct VerifiedWand {
  absl::InlinedVector<int, 3> blobs;             // by marker
  absl::InlinedVector<MarkerCentre, 3> centres;  // by marker
  absl::InlinedVector<bool, 3> whole;  // by marker: neither cut nor occluded nor disturbed
  WandImageFit fit;
  double cost = 0;              // chi-squared of pose, shape and likeness
  double confidence = 0;        // 0 to 1, from the cost
  double label_confidence = 1;  // 0.5 to 1: against the same blobs with flipped labels

  int OccludedCount() const;
};

struct Verdict {
  std::optional<VerifiedWand> wand;
  bool ambiguous = false;  // another one is as good; then `wand` is none
};

// Chooses among candidates by the brightness of their pixels: sub-pixel centres and radii against
// the pose, and how alike the markers are in brightness, colour and shape. Of two wands without a
// common blob that are equally good the brighter one is taken (the other is its reflection in a
// floor or a window); others are ambiguous. One thread at a time.
class WandVerifier {
 public:
  explicit WandVerifier(double min_confidence) : min_confidence_(min_confidence) {}

  Verdict Verify(const ImageView& image, absl::Span<const Blob> blobs, const WandFinder& finder,
                 absl::Span<const WandCandidate> candidates);

 private:
  struct Measured {
    int blob = 0;
    bool good = false;
    MarkerCentre centre;
  };
  const Measured& Measure(const ImageView& image, absl::Span<const Blob> blobs, int blob);
  std::optional<VerifiedWand> EvaluateOne(const ImageView& image, absl::Span<const Blob> blobs,
                                          const WandFinder& finder, const WandCandidate& candidate);
  Verdict Choose();
  struct Outlined {
    int blob = 0;
    bool shaded = false;
    std::optional<SphereOutline> outline;
  };
  const Outlined& OutlineOf(const ImageView& image, absl::Span<const Blob> blobs, int blob,
                            bool shaded);
  double ShapeCost(const ImageView& image, absl::Span<const Blob> blobs, const VerifiedWand& wand);
  // Centres of the outlines where those can be fitted.
  void FitOutlines(const ImageView& image, absl::Span<const Blob> blobs, VerifiedWand* wand);

  double min_confidence_;
  MarkerMeter meter_;
  std::vector<Measured> measured_;
  std::vector<Outlined> outlined_;
  std::vector<VerifiedWand> evaluated_;
};

}  // namespace rigcal::agent
