// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_verifier.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "agent/detect/blobs/blob_contrast.h"
#include "agent/identify/alike_things.h"
#include "agent/identify/outlined_centres.h"
#include "agent/identify/overlapping_markers.h"
#include "agent/identify/partial_evidence.h"
#include "agent/identify/partial_wands.h"
#include "agent/identify/restored_markers.h"
#include "agent/identify/squared.h"

namespace rigcal::agent {
namespace {

constexpr double kPlaceFloorPx = 0.05;  // what is left in the lens' model
constexpr double kVerifiedRadiusPx = 0.15, kVerifiedRadiusShare = 0.04;
// Before a saturated background a sphere looks that much smaller; one sigma of it and of its place.
constexpr double kSmallerPx = 0.8, kSmallerSigmaPx = 1, kSaturatedPlacePx = 0.5;
// Of a wand with a hidden marker: more is proved by its outlines only, known to so many radii.
constexpr double kProvedByCost = 9, kProvingSigma = 0.12;
constexpr double kHalfCost = 11.5, kCostScale = 2.5;  // confidence 0.5
// Of many sets of blobs some fit by chance: that much less cost is allowed for each e-fold.
constexpr double kTriedCost = 1.15, kFewTried = 20;
constexpr double kWhiteCost = 6;
constexpr double kMostAlike = 0.28;  // of what is around; a stick takes a sixth
constexpr double kGoesOn = 0.05;     // of what is around, in the marker's grey levels
constexpr double kTooAlike = 0.5;    // for its outline to be seen
constexpr double kPartialCost = 1, kPartialUnlikeness = 3, kPartialColourSigma = 0.08,
                 kPartialChance = 0.5, kMuchSeen = 0.4, kMostRelief = 0.5, kMostPartialFit = 2,
                 kMostFitWithStick = 3;
constexpr double kSeenStickGain = 2;
constexpr double kKnownPlace = 0.5;  // of a radius
// Of outlines.
constexpr double kWorthALook = 0.1;                     // confidence
constexpr double kWorthRestoring = 16;                  // cost of pose and likeness
constexpr double kDoubtfulPose = 1.5, kColourGain = 1;  // cost, of outlines by their colour
constexpr double kByOthersCost = 1.5;                   // its own size says nothing then
constexpr size_t kMaxOutlined = 6;
constexpr double kNoOutlineCost = 9, kLargeNoOutlineCost = 3;
constexpr double kMeterNoise = 0.015;  // see MarkerMeter::CollectPixels
constexpr double kOutlineNoise = 0.03, kResidualSigma = 0.4;
constexpr double kExcused = 0.75;  // of lopsidedness
constexpr double kMostlyOnOutline = 0.75, kHardlyOffOutline = 0.1, kMostMisfit = 2.5;
constexpr double kStretchSigma = 0.03, kStretchSigmaPx = 0.25;
// Of the other two outlines, where the third marker was measured and is not whole.
constexpr double kHiddenEvidence = 0.75;
constexpr double kMostMeanCost = 1.5;  // of a pixel of theirs; corners are outliers
constexpr double kCornerCost = 15;     // per unit above
constexpr double kRowEvidence = 4;     // against a wand in a row of things that look like it
// The same for each of such things near by, up to a few: grain of wood, leaves, labels. Hardly a
// wand has two of them near by; most of what such things make look like a wand has four and more.
constexpr double kAlikePartEvidence = 5, kAlikeEvidence = 1;
constexpr int kMostAlikeThings = 5;
constexpr double kOffOutlineSigma = 0.08;                        // of the sectors
constexpr double kUsualStretch = 0.15, kMeanStretchSigma = 0.1;  // of all spheres, by motion

// Blur makes a small disc's spread larger: its variance adds to radius^2 / 4.
bool IsWhole(const Blob& blob, const MarkerCentre& centre) {
  return !blob.touches_border && !centre.cut && centre.alike < kMostAlike &&
         centre.skewness < 0.02 + 4 * centre.skewness_sigma &&
         centre.spread < 1.15 + 4 / Squared(centre.radius_px) && centre.spread > 0.9;
}

// What an outline's fit leaves, over what noise and shading may leave.
double Misfit(const MarkerCentre& centre, const SphereOutline& outline) {
  const double noise = centre.noise_grey / centre.contrast_grey;
  return outline.residual * std::hypot(noise, kMeterNoise) / std::hypot(noise, kOutlineNoise);
}

}  // namespace

double WandVerifier::ConfidenceOf(double cost) const {
  return 1 / (1 + std::exp((cost + chance_cost_ - kHalfCost) / kCostScale));
}

bool WandVerifier::IsByEvidence(const VerifiedWand& wand) const {
  return ConfidenceOf(wand.cost) < min_confidence_;
}

std::optional<VerifiedWand> WandVerifier::EvaluateOne(const ImageView& image,
                                                      absl::Span<const Blob> blobs,
                                                      const WandFinder& finder,
                                                      const WandCandidate& candidate) {
  VerifiedWand wand;
  wand.blobs = candidate.blobs;
  int alike_count = 0;
  bool goes_on = true;
  for (size_t k = 0; k < candidate.blobs.size(); ++k) {
    const int index = candidate.blobs[k];
    if (static_cast<int>(k) == candidate.partial) {
      wand.centres.emplace_back().centre_px = blobs[static_cast<size_t>(index)].centre_px;
      wand.whole.push_back(false);
      continue;
    }
    const MeasuredMarker* const measured = markers_.Measure(image, blobs, index);
    if (measured == nullptr || !measured->good) return std::nullopt;
    wand.centres.push_back(measured->centre);
    // Another sphere of the wand looks like it.
    const Blob& blob = blobs[static_cast<size_t>(index)];
    goes_on = goes_on && measured->centre.same_grey > kGoesOn;
    for (const int other : candidate.blobs) {
      if (other == index) continue;
      const Blob& its = blobs[static_cast<size_t>(other)];
      goes_on = goes_on && !IsBeyond(blob, its);
      const double share = OverlapShare(blob, its);
      if (!(share > 0)) continue;
      wand.centres[k].alike -= share;
      markers_.OfBlob(index).beside = its;
    }
    alike_count += wand.centres[k].alike >= kMostAlike ? 1 : 0;
    if (wand.centres[k].alike >= kTooAlike || alike_count > 1) return std::nullopt;
    // With something else near its outline decides.
    wand.whole.push_back(!measured->centre.has_neighbour && IsWhole(blob, wand.centres[k]));
  }
  const int count = static_cast<int>(wand.blobs.size());
  // A room hardly goes on in the spheres' own light beside each that is measured; a bar does.
  if (goes_on && !without_.Has(WandMechanism::kBars)) return std::nullopt;
  if (!FitPose(finder, candidate.partial, &wand)) return std::nullopt;
  if (wand.fit.cost + Unlikeness(wand, in_room_) > kWorthRestoring) return std::nullopt;
  if (wand.OccludedCount() > (candidate.partial >= 0 ? 1 : 0) &&
      !without_.Has(WandMechanism::kRestoredOutlines)) {
    const VerifiedWand before = wand;
    RestoreByOutlines(image, blobs, &markers_, &wand);
    // The outline of a part is not where the others say.
    const double gained = kOccludedCost * (before.OccludedCount() - wand.OccludedCount());
    if (!FitPose(finder, candidate.partial, &wand) || wand.fit.cost > before.fit.cost + gained) {
      wand = before;
    }
  }
  if (in_room_ && wand.fit.cost > kDoubtfulPose && !without_.Has(WandMechanism::kColourOutlines)) {
    auto coloured = WithColouredOutlines(image, candidate.partial, &markers_, wand);
    if (coloured && FitPose(finder, candidate.partial, &coloured->wand) &&
        coloured->wand.fit.cost + kColourGain < wand.fit.cost) {
      wand = std::move(coloured->wand);
      for (const int blob : coloured->blobs) markers_.TakeColour(blob);
    }
  }
  const int occluded = wand.OccludedCount();
  if (occluded > 0 && candidate.partial < 0 && without_.Has(WandMechanism::kHiddenSpheres)) {
    return std::nullopt;
  }
  if (occluded > std::max(count == 1 ? 0 : 1, count / 3)) return std::nullopt;
  // Of all directions few are nearly along the line of sight.
  wand.cost =
      wand.fit.cost + Unlikeness(wand, in_room_) + Lopsidedness(wand) + TiltCost(wand.fit.tilt_rad);
  for (size_t k = 0; k < wand.whole.size(); ++k) {
    if (static_cast<int>(k) == candidate.partial) {
      wand.cost += kPartialCost + candidate.partial_cost;
    } else if (!wand.whole[k]) {
      wand.cost += kOccludedCost - Lopsidedness(wand.centres[k]);
    }
  }
  // Nor are there three such things: a stick between two, or much of the third.
  if (occluded > 0 && in_room_ && !candidate.has_stick) {
    wand.cost +=
        UnresolvedCost(wand) * (1 - std::min(kMostRelief, candidate.partial_share / kMuchSeen));
  }
  // So does much in a lit room: lamps, slats and what is seen between them.
  if (in_room_ && IsWhite(wand)) wand.cost += kWhiteCost;
  if (candidate.has_stick) wand.cost -= kSeenStickGain;
  // Without the third the other two must be the more alike. Fewer such sets fit by chance than of
  // three things that are measured.
  if (candidate.partial >= 0) {
    wand.cost += (kPartialUnlikeness - 1) * Unlikeness(wand, in_room_) +
                 Squared(ColourDifference(wand) / kPartialColourSigma) -
                 (1 - kPartialChance) * chance_cost_;
    // Windows are full of pairs of white things.
    if (in_room_ && (IsWhite(wand) || !SaysWhichMarkers(candidate, wand))) return std::nullopt;
    // Lamps of one kind are as round and as alike, but hardly as far apart and as large.
    const double most_fit = candidate.has_stick ? kMostFitWithStick : kMostPartialFit;
    if (in_room_ && wand.fit.cost > most_fit) return std::nullopt;
    wand.has_part = true;
    wand.part_share = candidate.partial_share;
    if (!without_.Has(WandMechanism::kEvidence))
      wand.evidence = PartialEvidence(candidate, wand, UnresolvedCost(wand), in_room_);
  }
  wand.confidence = ConfidenceOf(wand.cost - wand.evidence);
  return wand;
}

// False: no wand is seen like this.
bool WandVerifier::FitPose(const WandFinder& finder, int partial, VerifiedWand* wand) {
  absl::InlinedVector<MarkerSight, 4> sights;
  double radius = 0;
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    const MarkerCentre& centre = wand->centres[k];
    MarkerSight& sight = sights.emplace_back();
    if (!finder.Sight(centre.centre_px, &sight)) return false;
    if (static_cast<int>(k) == partial) continue;
    radius += 0.5 * centre.radius_px;
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
      sight.sigma_px += 0.3 * centre.radius_px;
      sight.radius_sigma_px += 0.3 * centre.radius_px;
    }
  }
  if (partial >= 0) {
    const auto part = static_cast<size_t>(partial);
    wand->centres[part].radius_px = radius;
    LoosenSight(radius, &sights[part]);
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
    if (wand.OccludedCount() > 0 || ConfidenceOf(wand.cost) < min_confidence_) return false;
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
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  absl::InlinedVector<std::pair<Eigen::Vector2d, double>, 3> stretches;
  for (size_t k = 0; k < wand.blobs.size(); ++k) {
    if (!wand.whole[k]) continue;
    const MarkerCentre& centre = wand.centres[k];
    const auto& outline = markers_.OutlineIn(image, wand, k);
    if (!outline) {
      // A notch, by the stick in front of it, is enough that none can be fitted to a large one.
      cost += centre.radius_px > kResolvedPx ? kLargeNoOutlineCost : kNoOutlineCost;
      continue;
    }
    if (outline->by_others) cost += kByOthersCost;
    // Three such things hardly fit a wand's pose, two do. (In a lit room: EvidenceOfOutlines.)
    if (!in_room_ && wand.OccludedCount() > 0) {
      cost += kCornerCost * std::max(0.0, outline->mean_cost - kMostMeanCost);
    }
    const double misfit = Squared(std::max(0.0, Misfit(centre, *outline) - 1) / kResidualSigma);
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
  return cost;
}

double WandVerifier::EvidenceOfOutlines(const ImageView& image, const VerifiedWand& wand) {
  if (without_.Has(WandMechanism::kEvidence)) return 0;
  const bool is_whole = wand.OccludedCount() == 0;
  absl::InlinedVector<OutlineMatch, 2> matches;
  for (size_t k = 0; k < wand.blobs.size(); ++k) {
    if (!wand.whole[k]) continue;
    const auto& outline = markers_.OutlineIn(image, wand, k);
    matches.emplace_back();
    if (!outline) continue;
    // Few large things are round, and dim spheres fit no better, by their noise.
    const bool is_likely = is_whole && wand.centres[k].radius_px > kResolvedPx;
    matches.back() = {is_likely ? 0 : Misfit(wand.centres[k], *outline), outline->off_outline};
    if (!is_whole) matches.back().misfit += std::max(0.0, outline->mean_cost - kMostMeanCost);
  }
  if (wand.has_part) return OutlineEvidence(matches);
  return ColourEvidence(wand) +
         (is_whole ? WholeOutlineEvidence(matches) : kHiddenEvidence * OutlineEvidence(matches));
}

bool WandVerifier::FitOutlines(const ImageView& image, VerifiedWand* wand) {
  OutlinedMarkers markers(wand->blobs.size());
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    if (!wand->whole[k] || !markers_.OutlineOf(image, wand->blobs[k])) continue;
    if (in_room_ && !without_.Has(WandMechanism::kColourOutlines))
      markers_.PreferColour(image, wand->blobs[k]);
    if (!without_.Has(WandMechanism::kBesideOutlines)) markers_.FitBeside(image, wand->blobs[k]);
    MeasuredMarker& measured = markers_.OfBlob(wand->blobs[k]);
    markers[k] = {&*measured.outline, &measured.pixels, measured.moved_px};
  }
  SetOutlinedCentres(markers, markers_.fitter(), wand, without_);
  const bool is_proved = wand->cost < kProvedByCost || wand->LargestSigmaRadii() < kProvingSigma;
  if ((wand->has_part || IsByEvidence(*wand)) && !is_proved) return false;
  const size_t seen = wand->blobs.size() - static_cast<size_t>(wand->OccludedCount());
  return seen >= std::min<size_t>(2, wand->blobs.size());
}

Verdict WandVerifier::Verify(const ImageView& image, absl::Span<const Blob> blobs,
                             const WandFinder& finder, absl::Span<const WandCandidate> candidates,
                             int tried, bool in_room, double* work) {
  chance_cost_ =
      without_.Has(WandMechanism::kChance) ? 0 : kTriedCost * std::log(1 + tried / kFewTried);
  in_room_ = in_room;
  markers_.StartSearch(blobs.size(), *work);
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
  std::stable_sort(evaluated_.begin(), evaluated_.end(),
                   [](const VerifiedWand& a, const VerifiedWand& b) { return a.cost < b.cost; });
  std::erase_if(evaluated_, [this](const VerifiedWand& wand) {
    return wand.confidence < std::min(kWorthALook, min_confidence_);
  });
  if (evaluated_.size() > kMaxOutlined) evaluated_.resize(kMaxOutlined);
  for (VerifiedWand& wand : evaluated_) {
    wand.cost += ShapeCost(image, wand);
    if (in_room_) {
      const int alike = without_.Has(WandMechanism::kAlikeThings)
                            ? 0
                            : std::min(ThingsLike(image, blobs, wand).near_count, kMostAlikeThings);
      wand.evidence += EvidenceOfOutlines(image, wand) -
                       (wand.has_part ? kAlikePartEvidence : kAlikeEvidence) * alike;
    }
    wand.confidence = ConfidenceOf(wand.cost - wand.evidence);
  }
  Verdict verdict = ChooseWand(min_confidence_, &evaluated_);
  // Not of its rivals: they are in the row, too.
  if (verdict.wand && in_room_ && !without_.Has(WandMechanism::kAlikeThings) &&
      ThingsLike(image, blobs, *verdict.wand).go_on_as_row) {
    verdict.wand->evidence -= kRowEvidence;
    verdict.wand->confidence = ConfidenceOf(verdict.wand->cost - verdict.wand->evidence);
    if (!IsConfident(*verdict.wand, min_confidence_)) verdict.wand.reset();
  }
  verdict.measured = count;
  verdict.left_out = markers_.is_out_of_work();
  *work = markers_.work();
  return verdict;
}

}  // namespace rigcal::agent
