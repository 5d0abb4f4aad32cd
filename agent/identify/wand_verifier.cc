// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_verifier.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "agent/identify/outlined_centres.h"
#include "agent/identify/restored_markers.h"
#include "agent/identify/squared.h"
#include "agent/identify/wand_evidence.h"

namespace rigcal::agent {
namespace {

constexpr double kPlaceFloorPx = 0.05;  // what is left in the lens' model
constexpr double kVerifiedRadiusPx = 0.15, kVerifiedRadiusShare = 0.04;
// Before a saturated background a sphere looks that much smaller; one sigma of it and of its place.
constexpr double kSmallerPx = 0.8, kSmallerSigmaPx = 1, kSaturatedPlacePx = 0.5;
constexpr double kNotWholeSigma = 0.3;  // of a radius, of a marker that is not whole by its pixels
constexpr double kWhiteCost = 6;
constexpr double kMostAlike = 0.28;  // of what is around; a stick takes a sixth
constexpr double kTooAlike = 0.5;    // for its outline to be seen
constexpr double kKnownPlace = 0.5;  // of a radius
// Of outlines.
constexpr double kWorthALook = 0.1;     // confidence
constexpr double kWorthRestoring = 16;  // cost of pose and likeness
constexpr size_t kMaxOutlined = 6;      // candidates
constexpr double kResolvedPx = 5.5;     // radius of a sphere that looks like nothing else
constexpr double kNoOutlineCost = 9, kLargeNoOutlineCost = 3;
constexpr double kResidualSigma = 0.4;
constexpr double kExcused = 0.75;  // of lopsidedness
constexpr double kMostlyOnOutline = 0.75, kHardlyOffOutline = 0.1, kMostMisfit = 2.5;
constexpr double kStretchSigma = 0.03, kStretchSigmaPx = 0.25;
constexpr double kOffOutlineSigma = 0.08;                        // of the sectors
constexpr double kUsualStretch = 0.15, kMeanStretchSigma = 0.1;  // of all spheres, by motion

// Blur makes a small disc's spread larger: its variance adds to radius^2 / 4.
bool IsWhole(const Blob& blob, const MarkerCentre& centre) {
  return !blob.touches_border && !centre.cut && centre.alike < kMostAlike &&
         centre.skewness < 0.02 + 4 * centre.skewness_sigma &&
         centre.spread < 1.15 + 4 / Squared(centre.radius_px) && centre.spread > 0.9;
}

}  // namespace

std::optional<VerifiedWand> WandVerifier::EvaluateOne(const ImageView& image,
                                                      absl::Span<const Blob> blobs,
                                                      const WandFinder& finder,
                                                      const WandCandidate& candidate) {
  VerifiedWand wand;
  wand.blobs = candidate.blobs;
  int alike_count = 0;
  for (const int index : candidate.blobs) {
    const MeasuredMarker* const measured = markers_.Measure(image, blobs, index);
    if (measured == nullptr || !measured->good) return std::nullopt;
    const MarkerCentre& centre = wand.centres.emplace_back(measured->centre);
    alike_count += centre.alike >= kMostAlike ? 1 : 0;
    if (centre.alike >= kTooAlike || alike_count > 1) return std::nullopt;
    // With something else near its outline decides.
    wand.whole.push_back(!centre.has_neighbour &&
                         IsWhole(blobs[static_cast<size_t>(index)], centre));
  }
  if (!FitPose(finder, &wand)) return std::nullopt;
  if (wand.fit.cost + Unlikeness(wand, in_room_) > kWorthRestoring) return std::nullopt;
  if (wand.OccludedCount() > 0 && !without_.Has(WandMechanism::kRestoredOutlines)) {
    RestoreByOutlines(image, blobs, &markers_, &wand);
  }
  // Labels need all three: two spheres do not say which ones they are.
  if (wand.OccludedCount() > 0 || !FitPose(finder, &wand)) return std::nullopt;
  // Of all directions few are nearly along the line of sight.
  wand.cost =
      wand.fit.cost + Unlikeness(wand, in_room_) + Lopsidedness(wand) + TiltCost(wand.fit.tilt_rad);
  // Much is white in a lit room: lamps, slats and what is seen between them.
  if (in_room_ && IsWhite(wand)) wand.cost += kWhiteCost;
  return wand;
}

// False: no wand is seen like this.
bool WandVerifier::FitPose(const WandFinder& finder, VerifiedWand* wand) {
  absl::InlinedVector<MarkerSight, 4> sights;
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    const MarkerCentre& centre = wand->centres[k];
    MarkerSight& sight = sights.emplace_back();
    if (!finder.Sight(centre.centre_px, &sight)) return false;
    sight.radius_px = centre.radius_px;
    const double variance_px2 = 0.5 * centre.covariance_px2.trace();
    sight.sigma_px = std::sqrt(variance_px2 + Squared(kPlaceFloorPx));
    sight.radius_sigma_px = std::hypot(kVerifiedRadiusPx + kVerifiedRadiusShare * centre.radius_px,
                                       std::sqrt(variance_px2));
    sight.radius_px += kSmallerPx * centre.saturated_behind;
    sight.radius_sigma_px =
        std::hypot(sight.radius_sigma_px, kSmallerSigmaPx * centre.saturated_behind);
    sight.sigma_px = std::hypot(sight.sigma_px, kSaturatedPlacePx * centre.saturated_behind);
    if (!wand->whole[k]) {
      sight.sigma_px += kNotWholeSigma * centre.radius_px;
      sight.radius_sigma_px += kNotWholeSigma * centre.radius_px;
    }
  }
  wand->px_per_m.clear();
  wand->diameter_m = finder.fit_options().diameter_m;
  if (sights.size() < 2) return true;
  if (!FitWand(sights, finder.shares(), finder.length_m(), finder.fit_options(), &wand->fit)) {
    return false;
  }
  for (size_t k = 0; k < sights.size(); ++k) {
    const double share = finder.shares()[k];
    const Eigen::Vector3d at = (1 - share) * wand->fit.first_m + share * wand->fit.last_m;
    wand->px_per_m.push_back(sights[k].scale_px / at.norm());
  }
  return true;
}

// Other pieces of the image of a wand that was measured already.
bool WandVerifier::IsKnown(const WandCandidate& candidate, absl::Span<const Blob> blobs) const {
  return std::ranges::any_of(evaluated_, [&](const VerifiedWand& wand) {
    if (ConfidenceOf(wand.cost) < min_confidence_) return false;
    if (SameBlobs(wand.blobs, candidate.blobs)) return false;  // its labels may be others
    for (size_t k = 0; k < candidate.blobs.size(); ++k) {
      const Blob& blob = blobs[static_cast<size_t>(candidate.blobs[k])];
      const MarkerCentre& centre = wand.centres[k];
      if (!((blob.centre_px - centre.centre_px).norm() < kKnownPlace * centre.radius_px)) {
        return false;
      }
    }
    return true;
  });
}

// The cost of shapes that are not those of spheres: of the outlines' fits, and of ellipses that
// differ within the wand. Motion stretches all spheres alike.
double WandVerifier::ShapeCost(const ImageView& image, const VerifiedWand& wand) {
  double cost = 0, weights = 0;
  absl::InlinedVector<OutlineMatch, 3> matches;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  absl::InlinedVector<std::pair<Eigen::Vector2d, double>, 3> stretches;
  for (size_t k = 0; k < wand.blobs.size(); ++k) {
    const MarkerCentre& centre = wand.centres[k];
    const auto& outline = markers_.OutlineOf(image, wand.blobs[k]);
    OutlineMatch& match = matches.emplace_back();
    if (!outline) {
      // A notch, by the stick in front of it, is enough that none can be fitted to a large one.
      cost += centre.radius_px > kResolvedPx ? kLargeNoOutlineCost : kNoOutlineCost;
      continue;
    }
    // Few large things are round, and dim spheres fit no better, by their noise.
    const double misfit_ratio = Misfit(centre, *outline);
    match = {centre.radius_px > kResolvedPx ? 0 : misfit_ratio, outline->off_outline};
    const double misfit = Squared(std::max(0.0, misfit_ratio - 1) / kResidualSigma);
    // The stick, or its shadow, in front of a sphere that is round everywhere else.
    const bool is_round =
        outline->on_outline > kMostlyOnOutline && outline->off_outline < kHardlyOffOutline;
    cost += is_round ? std::min(misfit, kMostMisfit) : misfit;
    // It takes a piece out of the image, which is lopsided then, but leaves the outline.
    if (is_round) cost -= kExcused * Lopsidedness(centre);
    cost += Squared(outline->off_outline / kOffOutlineSigma);
    const double sigma = kStretchSigma + kStretchSigmaPx / outline->radius_px;
    const double weight = 1 / Squared(sigma);
    stretches.emplace_back(outline->stretch, weight);
    mean += weight * outline->stretch;
    weights += weight;
  }
  if (weights > 0) mean /= weights;
  cost += Squared(std::max(0.0, mean.norm() - kUsualStretch) / kMeanStretchSigma);
  for (const auto& [stretch, weight] : stretches) cost += weight * (stretch - mean).squaredNorm();
  if (in_room_ && !without_.Has(WandMechanism::kEvidence)) {
    cost += ColourCost(wand) + WholeOutlineCost(matches);
  }
  return cost;
}

bool WandVerifier::FitOutlines(const ImageView& image, VerifiedWand* wand) {
  OutlinedMarkers markers(wand->blobs.size());
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    if (!markers_.OutlineOf(image, wand->blobs[k])) continue;
    if (!without_.Has(WandMechanism::kBesideOutlines)) markers_.FitBeside(image, wand->blobs[k]);
    MeasuredMarker& measured = markers_.OfBlob(wand->blobs[k]);
    markers[k] = {&*measured.outline, &measured.pixels, measured.moved_px};
  }
  SetOutlinedCentres(markers, markers_.fitter(), wand, without_);
  const size_t seen = wand->blobs.size() - static_cast<size_t>(wand->OccludedCount());
  return seen >= std::min<size_t>(2, wand->blobs.size());
}

Verdict WandVerifier::Verify(const ImageView& image, absl::Span<const Blob> blobs,
                             const WandFinder& finder, absl::Span<const WandCandidate> candidates,
                             bool in_room, double* pixels) {
  in_room_ = in_room;
  markers_.StartSearch(blobs.size(), *pixels);
  size_t count = 0;
  evaluated_.clear();
  double best = kHalfCost;
  for (const WandCandidate& candidate : candidates) {
    if (candidate.cost > best + kClearlyWorse) break;
    if (IsKnown(candidate, blobs)) {
      count += markers_.is_out_of_work() ? 0 : 1;
      continue;
    }
    auto wand = EvaluateOne(image, blobs, finder, candidate);
    if (!markers_.is_out_of_work()) ++count;
    if (!wand.has_value()) continue;
    if (wand->cost < best) best = std::min(best, wand->cost + ShapeCost(image, *wand));
    evaluated_.push_back(*std::move(wand));
  }
  std::ranges::stable_sort(evaluated_, {}, &VerifiedWand::cost);
  std::erase_if(evaluated_, [this](const VerifiedWand& wand) {
    return ConfidenceOf(wand.cost) < std::min(kWorthALook, min_confidence_);
  });
  if (evaluated_.size() > kMaxOutlined) evaluated_.resize(kMaxOutlined);
  for (VerifiedWand& wand : evaluated_) {
    wand.cost += ShapeCost(image, wand);
    wand.confidence = ConfidenceOf(wand.cost);
  }
  Verdict verdict = ChooseWand(min_confidence_, &evaluated_);
  verdict.measured = count;
  verdict.left_out = markers_.is_out_of_work();
  *pixels = markers_.work();
  return verdict;
}

}  // namespace rigcal::agent
