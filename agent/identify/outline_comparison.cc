// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outline_comparison.h"

#include <algorithm>
#include <cmath>

#include "agent/identify/squared.h"
#include "common/statistics/robust_statistics.h"

namespace rigcal::agent {
namespace {

constexpr double kLikeRadiusPx = 0.03, kLikeRadiusShare = 0.008;  // sigma of expected.radius_px
constexpr double kEdgePx2 = 0.05, kEdgeShare = 0.15;              // sigma of expected.edge_px2
constexpr double kLikeStretchSigma = 0.02, kLeastRatio = 0.5;  // sigma; least scatter of the others
// Tolerance of the radius that follows from pose and diameter: px plus a share of it.
constexpr double kPoseRadiusPx = 0.15, kPoseRadiusShare = 0.05;
// A sphere is partly hidden if it is this much smaller than the others say and its edge scatters
// this many times as much.
constexpr double kHiddenPx = 0.1, kHiddenRatio = 6;
constexpr double kShortPx = 0.2;              // the same against what diameter and distance say
constexpr double kMostSaturatedBehind = 0.1;  // share of pixels; more explain a small outline
// Error of the place of an outline that is not a sphere's: per pixel that it is smaller than the
// pose says, and, in radii, per relative slope of the light beyond one.
constexpr double kSmallError = 0.5, kDarkError = 0.1;
// Error of an outline that is longer than the others by more than kLikeStretch: radii per stretch.
constexpr double kStretchError = 2, kLikeStretch = 0.04;

// For an outline with an EdgeRatio above `least_ratio`.
double MissingRadius(const FittedOutlines& outlines, size_t marker,
                     const OutlineExpectation& expected, double least_ratio) {
  const double missing_px = expected.radius_px - outlines[marker]->radius_px;
  return expected.radius_px > 0 &&
                 missing_px > std::max(kHiddenPx, 1.5 * expected.radius_sigma_px) &&
                 EdgeRatio(outlines, marker) > least_ratio
             ? missing_px
             : 0;
}

}  // namespace

double ScatterOf(const SphereOutline& outline) { return std::max(1.0, Squared(outline.residual)); }

std::vector<EdgeScatter> ScatterOf(const FittedOutlines& outlines) {
  std::vector<const SphereOutline*> all;
  for (const auto& outline : outlines) all.push_back(outline ? &*outline : nullptr);
  return ScatterOfEdges(all);
}

OutlineExpectation ExpectationOf(const VerifiedWand& wand, const FittedOutlines& outlines,
                                 size_t marker) {
  OutlineExpectation expected;
  if (wand.px_per_m.size() != outlines.size()) return expected;
  std::vector<double> sizes_m, edges_px2, stretches_x, stretches_y;
  for (size_t k = 0; k < outlines.size(); ++k) {
    if (!outlines[k]) continue;
    sizes_m.push_back(outlines[k]->radius_px / wand.px_per_m[k]);
    edges_px2.push_back(Squared(outlines[k]->edge_px));
    stretches_x.push_back(outlines[k]->stretch.x());
    stretches_y.push_back(outlines[k]->stretch.y());
  }
  if (sizes_m.size() < 2) return expected;
  const double own_m = outlines[marker]->radius_px / wand.px_per_m[marker];
  const double size_m = Median(sizes_m);
  double spread_m = 0;  // two have no middle one, so their difference counts
  if (sizes_m.size() == 2) spread_m = std::abs(own_m - size_m);
  expected.radius_px = size_m * wand.px_per_m[marker];
  expected.radius_sigma_px =
      kLikeRadiusPx + kLikeRadiusShare * expected.radius_px + 2 * spread_m * wand.px_per_m[marker];
  if (sizes_m.size() > 2) {
    expected.edge_px2 = Median(edges_px2);
    expected.edge_sigma_px2 = kEdgePx2 + kEdgeShare * expected.edge_px2;
    expected.stretch = {Median(stretches_x), Median(stretches_y)};
    expected.stretch_sigma = kLikeStretchSigma;
  }
  return expected;
}

double EdgeRatio(const FittedOutlines& outlines, size_t marker) {
  double squares = 0, freedom = 0;
  for (size_t k = 0; k < outlines.size(); ++k) {
    if (k == marker || !outlines[k]) continue;
    squares += outlines[k]->edge_chi_squared;
    freedom += outlines[k]->edge_freedom;
  }
  const double others = std::max(kLeastRatio, squares / std::max(1.0, freedom));
  const SphereOutline& own = *outlines[marker];
  return own.edge_chi_squared / std::max(1.0, own.edge_freedom) / others;
}

double MissingRadius(const FittedOutlines& outlines, size_t marker,
                     const OutlineExpectation& expected) {
  return MissingRadius(outlines, marker, expected, kSuspectRatio);
}

double WrongByStretch(const FittedOutlines& outlines, size_t marker) {
  const Eigen::Vector2d& own = outlines[marker]->stretch;
  double extra = own.norm();
  for (size_t k = 0; k < outlines.size(); ++k) {
    if (k == marker || !outlines[k]) continue;
    const Eigen::Vector2d& other = outlines[k]->stretch;
    extra = std::min(extra, own.norm() > other.norm() ? (own - other).norm() : 0);
  }
  return kStretchError * outlines[marker]->radius_px * std::max(0.0, extra - kLikeStretch);
}

double WrongOutline(const VerifiedWand& wand, size_t marker, const SphereOutline& outline) {
  double wrong_px = kDarkError * outline.radius_px * std::max(0.0, outline.slope.norm() - 1);
  if (wand.diameter_m > 0 && wand.px_per_m.size() == wand.centres.size()) {
    const double radius_px = 0.5 * wand.diameter_m * wand.px_per_m[marker];
    const double small_px =
        radius_px - outline.radius_px - kPoseRadiusPx - kPoseRadiusShare * radius_px;
    wrong_px = std::hypot(wrong_px, kSmallError * std::max(0.0, small_px));
  }
  return wrong_px;
}

bool IsPartlyHidden(const VerifiedWand& wand, const FittedOutlines& outlines, size_t marker,
                    const OutlineExpectation& expected, const OutlinePixels& pixels) {
  const SphereOutline& own = *outlines[marker];
  // Before a saturated background any sphere looks smaller.
  double saturated = 0;
  for (const float one : pixels.saturated_behind) saturated += static_cast<double>(one);
  if (saturated > kMostSaturatedBehind * static_cast<double>(pixels.size())) return false;
  if (MissingRadius(outlines, marker, expected, kHiddenRatio) > 0) return true;
  // The others may be hidden too.
  if (!(wand.diameter_m > 0) || wand.px_per_m.size() != outlines.size()) return false;
  const double radius_px = 0.5 * wand.diameter_m * wand.px_per_m[marker];
  return radius_px - own.radius_px > std::max(kShortPx, 1.5 * expected.radius_sigma_px) &&
         own.edge_chi_squared > kHiddenRatio * std::max(1.0, own.edge_freedom);
}

}  // namespace rigcal::agent
