// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/container/inlined_vector.h"
#include "agent/identify/marker_centre.h"
#include "agent/identify/wand_image_fit.h"

namespace rigcal::agent {

// A wand whose markers were measured.
struct VerifiedWand {
  absl::InlinedVector<int, 3> blobs;             // by marker
  absl::InlinedVector<MarkerCentre, 3> centres;  // by marker
  absl::InlinedVector<bool, 3> whole;       // by marker: neither cut nor occluded nor disturbed
  absl::InlinedVector<double, 3> px_per_m;  // by marker, across the line of sight; by the pose
  double diameter_m = 0;                    // of the spheres; 0: not known
  WandImageFit fit;
  double cost = 0;              // chi-squared of pose, shape and likeness
  double confidence = 0;        // 0 to 1, from it
  double label_confidence = 1;  // 0.5 to 1: against the same blobs with flipped labels

  int OccludedCount() const;
};

// The cost of a marker that is not quite symmetric; and of all.
double Lopsidedness(const MarkerCentre& centre);
double Lopsidedness(const VerifiedWand& wand);
// How unlike the markers that were measured are in brightness and colour, as a chi-squared. LEDs
// differ in brightness; in a lit room (`in_room`) other things differ more.
double Unlikeness(const VerifiedWand& wand, bool in_room);
// Of all directions few are nearly along the line of sight.
double TiltCost(double tilt_rad);
// The largest between two markers, in rad.
double ColourDifference(const VerifiedWand& wand);
double MeanBrightness(const VerifiedWand& wand);  // grey levels, over all channels
// None of the markers has a colour.
bool IsWhite(const VerifiedWand& wand);

// A cost of confidence 0.5.
inline constexpr double kHalfCost = 11.5;
double ConfidenceOf(double cost);

// No blob in common.
bool Disjoint(const VerifiedWand& a, const VerifiedWand& b);
// The markers are in the same places, in whatever order: the same wand of other pieces of its
// image.
bool SamePlaces(const VerifiedWand& a, const VerifiedWand& b);
}  // namespace rigcal::agent
