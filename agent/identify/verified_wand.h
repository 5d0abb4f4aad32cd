// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/container/inlined_vector.h"
#include "agent/identify/marker_centre.h"
#include "agent/identify/wand_image_fit.h"
#include "agent/identify/wand_score.h"

namespace rigcal::agent {

// A wand whose markers were measured.
struct VerifiedWand {
  absl::InlinedVector<int, 3> blobs;             // by marker
  absl::InlinedVector<MarkerCentre, 3> centres;  // by marker
  absl::InlinedVector<bool, 3> whole;       // by marker: neither cut nor occluded nor disturbed
  absl::InlinedVector<double, 3> px_per_m;  // by marker, across the line of sight; by the pose
  double diameter_m = 0;                    // of the spheres; 0: not known
  WandImageFit fit;
  WandFeatures features;
  double log_odds = 0;          // WandLogOdds
  double confidence = 0;        // 0 to 1, from it
  double label_confidence = 1;  // 0.5 to 1: against the same blobs with flipped labels

  int OccludedCount() const;
};

// The mean of the markers' plateaus, grey levels over all channels.
double MeanBrightness(const VerifiedWand& wand);
// None of the markers has a colour.
bool IsWhite(const VerifiedWand& wand);

// No blob in common.
bool Disjoint(const VerifiedWand& a, const VerifiedWand& b);
// The markers are in the same places, in whatever order: the same wand, found in other pieces of
// its image.
bool SamePlaces(const VerifiedWand& a, const VerifiedWand& b);

}  // namespace rigcal::agent
