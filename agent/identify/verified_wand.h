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
  double evidence = 0;          // of what the cost does not count, as a chi-squared
  double confidence = 0;        // 0 to 1, from both
  bool has_part = false;        // of a marker only a part is seen (FindPartialWands)
  double part_share = 0;        // of its disc; 0: none is seen, or not how much
  double label_confidence = 1;  // 0.5 to 1: against the same blobs with flipped labels

  int OccludedCount() const;
  // Of the markers that are seen whole the most uncertain centre, one sigma, in radii.
  double LargestSigmaRadii() const;
};

// Of the radius of a marker that looks like nothing else.
inline constexpr double kResolvedPx = 5.5;

// Cost of an occluded marker, in chi-squared.
inline constexpr double kOccludedCost = 7.5;

// The cost of a marker that is not quite symmetric, at most that of an occluded one; and of all
// that were measured.
double Lopsidedness(const MarkerCentre& centre);
double Lopsidedness(const VerifiedWand& wand);
// How unlike the markers that were measured are in brightness and colour, as a chi-squared. LEDs
// differ in brightness; in a lit room (`in_room`) other things differ more.
double Unlikeness(const VerifiedWand& wand, bool in_room);
// Of all directions few are nearly along the line of sight.
double TiltCost(double tilt_rad);
// Two small spheres look like any two small things, such as labels on books.
double UnresolvedCost(const VerifiedWand& wand);
// The largest between two markers that were measured, in rad.
double ColourDifference(const VerifiedWand& wand);
double MeanBrightness(const VerifiedWand& wand);  // grey levels, over all channels
// None of the markers has a colour.
bool IsWhite(const VerifiedWand& wand);

// No blob in common.
bool Disjoint(const VerifiedWand& a, const VerifiedWand& b);
// The markers are in the same places, in whatever order: the same wand of other pieces of its
// image.
bool SamePlaces(const VerifiedWand& a, const VerifiedWand& b);
// The same markers are seen whole, of another part of the hidden one.
bool SameWholes(const VerifiedWand& a, const VerifiedWand& b);
// What `part` takes for whole markers are markers of `wand`, not the same that are whole there: the
// wand explains them, and another one besides.
bool IsPartOf(const VerifiedWand& part, const VerifiedWand& wand);
// The same blobs are seen whole, as whichever markers, and another one is hidden.
bool SameWholeBlobs(const VerifiedWand& a, const VerifiedWand& b);

}  // namespace rigcal::agent
