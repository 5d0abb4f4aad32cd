// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_verifier.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "agent/identify/outlined_centres.h"
#include "agent/identify/restored_markers.h"
#include "agent/identify/squared.h"
#include "agent/identify/wand_features.h"

namespace rigcal::agent {
namespace {

constexpr double kPlaceFloorPx = 0.05;  // one sigma of what the lens model leaves
// One sigma of a measured radius: px plus a share of it.
constexpr double kVerifiedRadiusPx = 0.15, kVerifiedRadiusShare = 0.04;
// Before a saturated background a sphere looks smaller by this; sigmas of that and of its place.
constexpr double kSmallerPx = 0.8, kSmallerSigmaPx = 1, kSaturatedPlacePx = 0.5;
constexpr double kNotWholeSigma = 0.3;  // radii, added for a marker that is not whole by its pixels
constexpr double kMostAlike = 0.28;     // MarkerCentre::alike; a stick takes a sixth
constexpr double kTooAlike = 0.5;       // the same, for its outline to be seen
constexpr double kKnownPlace = 0.5;     // of a radius
constexpr double kWorthALook = -2.2;    // log-odds of a wand whose outlines are fitted
constexpr size_t kMaxOutlined = 6;      // candidates whose outlines are fitted

// Blur makes the spread of a small disc larger: its variance adds to radius^2 / 4.
bool IsWhole(const Blob& blob, const MarkerCentre& centre) {
  return !blob.touches_border && !centre.cut && centre.alike < kMostAlike &&
         centre.skewness < 0.02 + 4 * centre.skewness_sigma &&
         centre.spread < 1.15 + 4 / Squared(centre.radius_px) && centre.spread > 0.9;
}

}  // namespace

const char* WandVerifier::EvaluateOne(const ImageView& image, absl::Span<const Blob> blobs,
                                      const WandFinder& finder, const WandCandidate& candidate,
                                      VerifiedWand* wand) {
  wand->blobs = candidate.blobs;
  wand->fit = candidate.fit;
  int alike_count = 0;
  for (const int index : candidate.blobs) {
    const Blob& blob = blobs[static_cast<size_t>(index)];
    const MeasuredMarker* const measured = markers_.Measure(image, blobs, index);
    if (measured == nullptr) return "not measured: the budget of the image is used up";
    const MarkerCentre& centre = wand->centres.emplace_back(measured->centre);
    if (!measured->good) {
      wand->centres.back().centre_px = blob.centre_px;
      return "a blob hardly differs from what is around it";
    }
    alike_count += centre.alike >= kMostAlike ? 1 : 0;
    if (centre.alike >= kTooAlike || alike_count > 1) {
      return "what is around a blob looks like the blob";
    }
    // If something else is near, the outline decides.
    wand->whole.push_back(!centre.has_neighbour && IsWhole(blob, centre));
  }
  if (!FitPose(finder, wand)) return "no pose of the wand explains the places and radii";
  MeasureLikeness(wand);
  wand->log_odds = WandLogOdds(wand->features, in_room_);
  if (wand->log_odds < kWorthALook) return "pose, brightness or colour do not fit";
  if (wand->OccludedCount() > 0 && !without_.Has(WandMechanism::kRestoredOutlines)) {
    RestoreByOutlines(image, blobs, &markers_, wand);
  }
  // Labels need all three spheres: two do not say which ones they are.
  if (wand->OccludedCount() > 0) return "a blob is not the image of a whole sphere";
  if (!FitPose(finder, wand)) return "no pose of the wand explains the outlines";
  MeasureLikeness(wand);
  wand->log_odds = WandLogOdds(wand->features, in_room_);
  return nullptr;
}

// Returns false if no pose of a wand explains what is seen.
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

// Tells whether a candidate consists of other pieces of a wand that was already measured.
bool WandVerifier::IsKnown(const WandCandidate& candidate, absl::Span<const Blob> blobs) const {
  return std::ranges::any_of(evaluated_, [&](const VerifiedWand& wand) {
    if (ConfidenceOf(wand.log_odds) < min_confidence_) return false;
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

void WandVerifier::Score(const ImageView& image, VerifiedWand* wand) {
  absl::InlinedVector<const SphereOutline*, 3> outlines;
  for (const int blob : wand->blobs) {
    const auto& outline = markers_.OutlineOf(image, blob);
    outlines.push_back(outline ? &*outline : nullptr);
  }
  MeasureShapes(outlines, wand);
  wand->log_odds = WandLogOdds(wand->features, in_room_);
  wand->confidence = ConfidenceOf(wand->log_odds);
}

bool WandVerifier::FitOutlines(const ImageView& image, VerifiedWand* wand) {
  OutlinedMarkers markers(wand->blobs.size());
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    if (!markers_.OutlineOf(image, wand->blobs[k])) continue;
    MeasuredMarker& measured = markers_.OfBlob(wand->blobs[k]);
    markers[k] = {&*measured.outline, &measured.pixels};
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
  double best = 0;  // log-odds
  for (const WandCandidate& candidate : candidates) {
    const double bound = MostLogOdds(in_room_) - kCostLogOdds * candidate.cost;
    if (bound < best - kCostLogOdds * kClearlyWorse) break;
    if (IsKnown(candidate, blobs)) {
      count += markers_.is_out_of_work() ? 0 : 1;
      continue;
    }
    VerifiedWand wand;
    const char* const refusal = EvaluateOne(image, blobs, finder, candidate, &wand);
    if (!markers_.is_out_of_work()) ++count;
    if (refusal != nullptr) {
      if (trials_ != nullptr) trials_->push_back({std::move(wand), refusal, in_room_});
      continue;
    }
    if (wand.log_odds > best) {
      VerifiedWand scored = wand;
      Score(image, &scored);
      best = std::max(best, scored.log_odds);
    }
    evaluated_.push_back(std::move(wand));
  }
  std::ranges::stable_sort(evaluated_, std::ranges::greater(), &VerifiedWand::log_odds);
  std::erase_if(evaluated_, [this](const VerifiedWand& wand) {
    return wand.log_odds < kWorthALook && ConfidenceOf(wand.log_odds) < min_confidence_;
  });
  if (evaluated_.size() > kMaxOutlined) evaluated_.resize(kMaxOutlined);
  for (VerifiedWand& wand : evaluated_) {
    Score(image, &wand);
    if (trials_ != nullptr) trials_->push_back({wand, "", in_room_});
  }
  Verdict verdict = ChooseWand(min_confidence_, &evaluated_);
  verdict.measured = count;
  verdict.left_out = markers_.is_out_of_work();
  *pixels = markers_.work();
  return verdict;
}

}  // namespace rigcal::agent
