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
  absl::InlinedVector<double, 3> px_per_m;  // by marker: scale across the line of sight
  double diameter_m = 0;                    // of the spheres; 0: not known
  WandImageFit fit;
  WandFeatures features;
  double log_odds = 0;          // WandLogOdds
  double confidence = 0;        // 0 to 1, from it
  double label_confidence = 1;  // 0.5 to 1: against flipped labels of the same blobs

  int OccludedCount() const;
};

// Returns the mean of the markers' plateaus, grey levels as a norm over all channels.
double MeanBrightness(const VerifiedWand& wand);
// Tells whether all markers are white.
bool IsWhite(const VerifiedWand& wand);

// Tells whether they have no blob in common.
bool Disjoint(const VerifiedWand& a, const VerifiedWand& b);
// The markers are in the same places, in either order: one wand, in other pieces of its image.
bool SamePlaces(const VerifiedWand& a, const VerifiedWand& b);

}  // namespace rigcal::agent
