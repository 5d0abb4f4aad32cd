// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_verifier.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "agent/detect/blobs/blob_contrast.h"
#include "agent/identify/outlined_centres.h"
#include "agent/identify/overlapping_markers.h"
#include "agent/identify/partial_wands.h"

namespace rigcal::agent {
namespace {

constexpr double kPlaceFloorPx = 0.05;  // what is left in the lens' model
constexpr double kVerifiedRadiusPx = 0.15, kVerifiedRadiusShare = 0.04;
constexpr double kHalfCost = 11.5;  // confidence 0.5
constexpr double kCostScale = 2.5;
// Of many sets of blobs some fit by chance: that much less cost is allowed for each e-fold.
constexpr double kTriedCost = 1.15, kFewTried = 20;
constexpr double kResolvedPx = 5.5, kUnresolvedCost = 2.7;  // per pixel of the radius
constexpr double kWhiteCost = 6, kWhiteGrey = 240;
constexpr double kTiltCost = 4;      // of the logarithm of its cosine
constexpr double kMostAlike = 0.28;  // of what is around; a stick takes a sixth
constexpr double kMostHidden = 0.2;  // of a marker, by others of the wand
constexpr double kPartialCost = 1, kPartialUnlikeness = 3, kPartialColourSigma = 0.08,
                 kPartialChance = 0.5, kMuchSeen = 0.4, kMostRelief = 0.5;
constexpr double kSeenStickGain = 2;
constexpr double kMargin = 8;  // in cost, of a wand against the next best
constexpr double kFlippedMargin = 5.5;
constexpr double kBrighter = 1.25;  // than its reflection
constexpr double kCertain = 0.999;
constexpr double kKnownPlace = 0.5;                 // of a radius
constexpr double kOwnPlacePx = 1, kOwnPlace = 0.6;  // of a marker's centre, by its blob's radius
// Of outlines.
constexpr double kWorthALook = 0.1;      // confidence
constexpr double kWorthRestoring = 16;   // cost of pose and likeness
constexpr double kLeastOnOutline = 0.6;  // of the sectors of a whole sphere
constexpr double kMostOffOutline = 0.15;
constexpr double kLeastOfCutOutline = 0.5, kMostOffCutOutline = 0.07;
constexpr double kMostStretch = 0.12, kMostStretchPx = 0.5;
constexpr double kHardlyOnOutline = 0.4;  // before it is known what is beside it
constexpr int kNearRounds = 2;
// What the other spheres say of one.
constexpr double kByOthersRadiusPx = 0.1, kByOthersRadiusShare = 0.03, kOtherStretch = 0.03,
                 kOtherEdgePx2 = 0.3;
constexpr double kByOthersCost = 1.5;  // its own size says nothing then
constexpr double kWorkOfFit = 500;     // in the pixels that a measurement reads
constexpr size_t kMaxOutlined = 6;
constexpr double kNoOutlineCost = 9, kLargeNoOutlineCost = 3;
constexpr double kMeterNoise = 0.015;  // see MarkerMeter::CollectPixels
constexpr double kOutlineNoise = 0.03, kResidualSigma = 0.4;
constexpr double kExcused = 0.75;  // of lopsidedness
constexpr double kMostlyOnOutline = 0.75, kHardlyOffOutline = 0.1, kMostMisfit = 2.5;
constexpr double kStretchSigma = 0.03, kStretchSigmaPx = 0.25;
constexpr double kOffOutlineSigma = 0.08;                        // of the sectors
constexpr double kUsualStretch = 0.15, kMeanStretchSigma = 0.1;  // of all spheres, by motion

double Squared(double x) { return x * x; }

// Blur makes a small disc's spread larger: its variance adds to radius^2 / 4.
bool IsWhole(const Blob& blob, const MarkerCentre& centre) {
  return !blob.touches_border && !centre.cut && centre.alike < kMostAlike &&
         centre.skewness < 0.02 + 4 * centre.skewness_sigma &&
         centre.spread < 1.15 + 4 / Squared(centre.radius_px) && centre.spread > 0.9;
}

// Or else something beside it was measured.
bool IsInBlob(const Eigen::Vector2d& centre_px, const Blob& blob) {
  const double radius_px = std::sqrt(blob.area_px / std::numbers::pi);
  return (centre_px - blob.centre_px).norm() < kOwnPlacePx + kOwnPlace * radius_px;
}

// Beyond the border there is nothing to be seen of an outline, but nothing else either.
bool IsOnOutline(const std::optional<SphereOutline>& outline, bool is_cut = false) {
  return outline && outline->on_outline >= (is_cut ? kLeastOfCutOutline : kLeastOnOutline) &&
         outline->off_outline <= (is_cut ? kMostOffCutOutline : kMostOffOutline) &&
         outline->stretch.norm() <= kMostStretch + kMostStretchPx / outline->radius_px;
}

// None of the markers has a colour.
bool IsWhite(const VerifiedWand& wand) {
  return std::ranges::all_of(wand.centres, [](const MarkerCentre& centre) {
    return !(centre.contrast_grey > 0) || centre.plateau_grey.minCoeff() >= kWhiteGrey;
  });
}

// Two small spheres look like any two small things, such as labels on books.
double UnresolvedCost(const VerifiedWand& wand) {
  double radius_px = 0;
  int count = 0;
  for (size_t k = 0; k < wand.whole.size(); ++k) {
    if (!wand.whole[k]) continue;
    radius_px += wand.centres[k].radius_px;
    ++count;
  }
  if (count == 0) return 0;
  return kUnresolvedCost * std::max(0.0, kResolvedPx - radius_px / count);
}

}  // namespace

double WandVerifier::ConfidenceOf(double cost) const {
  return 1 / (1 + std::exp((cost + chance_cost_ - kHalfCost) / kCostScale));
}

// None where the time for it is up.
const WandVerifier::Measured* WandVerifier::Measure(const ImageView& image,
                                                    absl::Span<const Blob> blobs, int blob) {
  int& index = measured_of_[static_cast<size_t>(blob)];
  const Blob& seen = blobs[static_cast<size_t>(blob)];
  for (size_t i = 0; index < 0 && i < measured_count_; ++i) {
    const bool same =
        measured_[i].blob_px == seen.centre_px && measured_[i].blob_area_px == seen.area_px;
    if (same) index = static_cast<int>(i);
  }
  if (index >= 0) return &measured_[static_cast<size_t>(index)];
  const double work = MarkerMeter::WorkOf(seen);
  if (work > work_) {
    out_of_work_ = true;
    return nullptr;
  }
  work_ -= work;
  if (measured_count_ == measured_.size()) measured_.emplace_back();
  index = static_cast<int>(measured_count_);
  Measured& measured = measured_[measured_count_++];
  measured.blob_px = seen.centre_px;
  measured.blob_area_px = seen.area_px;
  measured.tried = measured.retried = measured.by_others = false;
  measured.outline.reset();
  measured.beside.reset();
  measured.good = meter_.Measure(image, seen, &measured.centre) &&
                  measured.centre.contrast_grey >= kMinContrastGrey;
  if (measured.good) meter_.CollectPixels(image, measured.centre, &measured.pixels);
  return &measured;
}

// Something behind a marker moves and skews its centroid, but not its outline.
void WandVerifier::Restore(const ImageView& image, absl::Span<const Blob> blobs,
                           VerifiedWand* wand) {
  const auto restore = [&](size_t k, const std::optional<SphereOutline>& outline) {
    const Blob& blob = blobs[static_cast<size_t>(wand->blobs[k])];
    MarkerCentre& centre = wand->centres[k];
    const bool is_cut = centre.cut || blob.touches_border;
    if (!IsOnOutline(outline, is_cut) || !(is_cut || IsInBlob(outline->centre_px, blob))) {
      return false;
    }
    wand->whole[k] = wand->outlined[k] = true;
    centre.centre_px = outline->centre_px;
    centre.radius_px = outline->radius_px;
    centre.covariance_px2 = std::max(1.0, Squared(outline->residual)) * outline->covariance_px2;
    centre.skewness = 0;
    if (is_cut) centre.second_moment_px2 = outline->SecondMoment();
    return true;
  };
  absl::InlinedVector<size_t, 3> lost, to_retry;
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    const MarkerCentre& centre = wand->centres[k];
    if (wand->whole[k]) continue;
    const bool is_cut = centre.cut || blobs[static_cast<size_t>(wand->blobs[k])].touches_border;
    const bool may_be = centre.contrast_grey > 0 && HiddenShare(*wand, k) < kMostHidden &&
                        centre.alike < kMostAlike;
    if (may_be && restore(k, OutlineOf(image, wand->blobs[k]))) continue;
    lost.push_back(k);
    if (may_be && !is_cut) to_retry.push_back(k);
    // With two that are not whole it is no wand.
    if (lost.size() > 1) return;
  }
  for (const size_t k : to_retry) restore(k, OutlineIn(image, *wand, k));
}

std::optional<VerifiedWand> WandVerifier::EvaluateOne(const ImageView& image,
                                                      absl::Span<const Blob> blobs,
                                                      const WandFinder& finder,
                                                      const WandCandidate& candidate) {
  VerifiedWand wand;
  wand.blobs = candidate.blobs;
  for (size_t k = 0; k < candidate.blobs.size(); ++k) {
    const int index = candidate.blobs[k];
    wand.outlined.push_back(false);
    if (static_cast<int>(k) == candidate.partial) {
      wand.centres.emplace_back().centre_px = blobs[static_cast<size_t>(index)].centre_px;
      wand.whole.push_back(false);
      continue;
    }
    const Measured* const measured = Measure(image, blobs, index);
    if (measured == nullptr || !measured->good) return std::nullopt;
    wand.centres.push_back(measured->centre);
    // Another sphere of the wand looks like it.
    const Blob& blob = blobs[static_cast<size_t>(index)];
    for (const int other : candidate.blobs) {
      if (other == index) continue;
      const Blob& its = blobs[static_cast<size_t>(other)];
      const double share = OverlapShare(blob, its);
      if (!(share > 0)) continue;
      wand.centres[k].alike -= share;
      OfBlob(index).beside = its;
    }
    if (wand.centres[k].alike >= kMostAlike) return std::nullopt;
    // With something else near its outline decides.
    wand.whole.push_back(!measured->centre.has_neighbour && IsWhole(blob, wand.centres[k]));
  }
  const int count = static_cast<int>(wand.blobs.size());
  if (!FitPose(finder, candidate.partial, &wand)) return std::nullopt;
  if (wand.fit.cost + Unlikeness(wand, in_room_) > kWorthRestoring) return std::nullopt;
  if (wand.OccludedCount() > (candidate.partial >= 0 ? 1 : 0)) {
    const VerifiedWand before = wand;
    Restore(image, blobs, &wand);
    // The outline of a part is not where the others say.
    const double gained = kOccludedCost * (before.OccludedCount() - wand.OccludedCount());
    if (!FitPose(finder, candidate.partial, &wand) || wand.fit.cost > before.fit.cost + gained) {
      wand = before;
    }
  }
  const int occluded = wand.OccludedCount();
  if (occluded > std::max(count == 1 ? 0 : 1, count / 3)) return std::nullopt;
  // Of all directions few are nearly along the line of sight.
  wand.cost = wand.fit.cost + Unlikeness(wand, in_room_) + Lopsidedness(wand) -
              kTiltCost * std::log(std::max(0.01, std::cos(wand.fit.tilt_rad)));
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
  }
  wand.confidence = ConfidenceOf(wand.cost);
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
    sight.sigma_px = std::sqrt(0.5 * centre.covariance_px2.trace() + Squared(kPlaceFloorPx));
    sight.radius_sigma_px = kVerifiedRadiusPx + kVerifiedRadiusShare * centre.radius_px;
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

Verdict WandVerifier::Choose() {
  Verdict verdict;
  if (evaluated_.empty()) return verdict;
  std::stable_sort(evaluated_.begin(), evaluated_.end(),
                   [](const VerifiedWand& a, const VerifiedWand& b) { return a.cost < b.cost; });
  size_t best = 0;
  for (size_t i = 1; i < evaluated_.size(); ++i) {
    const VerifiedWand &now = evaluated_[best], &other = evaluated_[i];
    if (other.confidence < min_confidence_ || SameBlobs(now.blobs, other.blobs)) continue;
    if (SameWholes(now, other) || SamePlaces(now, other)) continue;
    if (Disjoint(now, other)) {
      const double ratio = MeanBrightness(other) / MeanBrightness(now);
      if (ratio > kBrighter) best = i;
      if (ratio > kBrighter || ratio < 1 / kBrighter) continue;
    }
    // A part of the wand with something else beside it.
    if (!Disjoint(now, other) && other.OccludedCount() > now.OccludedCount()) continue;
    // The same two spheres the other way round; the labels have a confidence of their own.
    const bool is_flipped = SameWholeBlobs(now, other);
    verdict.ambiguous |= other.cost < now.cost + (is_flipped ? kFlippedMargin : kMargin);
  }
  VerifiedWand& wand = evaluated_[best];
  if (wand.confidence < min_confidence_) return Verdict();
  if (verdict.ambiguous) return verdict;
  for (const VerifiedWand& other : evaluated_) {
    if (&other == &wand || !SameBlobs(wand.blobs, other.blobs)) continue;
    const double certainty = 1 / (1 + std::exp(0.5 * (wand.cost - other.cost)));
    wand.label_confidence = std::min(wand.label_confidence, certainty);
  }
  wand.label_confidence = std::clamp(wand.label_confidence, 0.5, kCertain);
  if (wand.blobs.size() == 1) wand.label_confidence = 1;
  verdict.wand = wand;
  return verdict;
}

const std::optional<SphereOutline>& WandVerifier::OutlineOf(const ImageView& image, int blob) {
  Measured& measured = OfBlob(blob);
  if (measured.tried) return measured.outline;
  const double work = kWorkOfFit * (measured.centre.has_neighbour ? kNearRounds : 1);
  if (work > work_) {
    out_of_work_ = true;
    return measured.outline;
  }
  work_ -= work;
  measured.tried = true;
  const MarkerCentre& centre = measured.centre;
  SphereOutline outline{.centre_px = centre.centre_px, .radius_px = centre.radius_px};
  Eigen::Matrix2d second_moment_px2 = centre.second_moment_px2;
  // What the border leaves of a disc says nothing of its shape.
  if (centre.cut) {
    second_moment_px2 = 0.25 * Squared(centre.radius_px) * Eigen::Matrix2d::Identity();
  }
  if (!centre.has_neighbour && !measured.beside) {
    if (fitter_.Fit(measured.pixels, second_moment_px2, {}, &outline)) {
      measured.outline = outline;
    }
    return measured.outline;
  }
  // What is beside it can be told once it is known where that is.
  Blob around;
  around.centre_px = centre.centre_px;
  around.second_moment_px2 = centre.second_moment_px2;
  for (int round = 0; round < kNearRounds; ++round) {
    if (!meter_.CollectNear(image, around, centre, &measured.pixels)) return measured.outline;
    if (measured.beside) LeaveOutBeyond(around, *measured.beside, &measured.pixels);
    outline.parameters.setZero();
    if (!fitter_.Fit(measured.pixels, round == 0 ? second_moment_px2 : around.second_moment_px2, {},
                     &outline)) {
      return measured.outline;
    }
    if (outline.on_outline < kHardlyOnOutline) return measured.outline;
    around.centre_px = outline.centre_px;
    around.second_moment_px2 = outline.SecondMoment();
  }
  measured.outline = outline;
  return measured.outline;
}

bool WandVerifier::ExpectFromOthers(const ImageView& image, const VerifiedWand& wand, size_t marker,
                                    OutlineExpectation* expected,
                                    Eigen::Matrix2d* second_moment_px2) {
  if (wand.px_per_m.size() != wand.blobs.size()) return false;
  *expected = OutlineExpectation();
  second_moment_px2->setZero();
  int count = 0;
  for (size_t k = 0; k < wand.blobs.size(); ++k) {
    if (k == marker || !wand.whole[k]) continue;
    const auto& outline = OutlineOf(image, wand.blobs[k]);
    if (!IsOnOutline(outline)) continue;
    const double scale = wand.px_per_m[marker] / wand.px_per_m[k];
    expected->radius_px += scale * outline->radius_px;
    expected->stretch += outline->stretch;
    expected->edge_px2 += Squared(outline->edge_px);
    *second_moment_px2 += Squared(scale) * outline->SecondMoment();
    ++count;
  }
  if (count == 0 || count + 1 < static_cast<int>(wand.blobs.size())) return false;
  expected->radius_px /= count;
  expected->stretch /= count;
  expected->edge_px2 /= count;
  *second_moment_px2 /= count;
  expected->radius_sigma_px = kByOthersRadiusPx + kByOthersRadiusShare * expected->radius_px;
  expected->stretch_sigma = kOtherStretch;
  expected->edge_sigma_px2 = kOtherEdgePx2;
  return true;
}

const std::optional<SphereOutline>& WandVerifier::OutlineIn(const ImageView& image,
                                                            const VerifiedWand& wand,
                                                            size_t marker) {
  const auto& outline = OutlineOf(image, wand.blobs[marker]);
  Measured& measured = OfBlob(wand.blobs[marker]);
  const MarkerCentre& centre = measured.centre;
  OutlineExpectation expected;
  Blob around;
  if (IsOnOutline(outline) || measured.retried || !measured.tried ||
      !ExpectFromOthers(image, wand, marker, &expected, &around.second_moment_px2)) {
    return outline;
  }
  if (kWorkOfFit * kNearRounds > work_) {
    out_of_work_ = true;
    return outline;
  }
  work_ -= kWorkOfFit * kNearRounds;
  measured.retried = true;
  around.centre_px = centre.centre_px;
  SphereOutline again{.centre_px = centre.centre_px, .radius_px = expected.radius_px};
  for (int round = 0; round < kNearRounds; ++round) {
    again.parameters.setZero();
    if (!meter_.CollectNear(image, around, centre, &retry_)) return outline;
    if (measured.beside) LeaveOutBeyond(around, *measured.beside, &retry_);
    if (!fitter_.Fit(retry_, around.second_moment_px2, {}, &again, expected)) {
      return outline;
    }
    around.centre_px = again.centre_px;
    around.second_moment_px2 = again.SecondMoment();
  }
  if (!IsOnOutline(again)) return outline;
  measured.outline = again;
  measured.by_others = true;
  std::swap(measured.pixels, retry_);
  return measured.outline;
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
    const auto& outline = OutlineIn(image, wand, k);
    if (!outline) {
      // A notch, by the stick in front of it, is enough that none can be fitted to a large one.
      cost += centre.radius_px > kResolvedPx ? kLargeNoOutlineCost : kNoOutlineCost;
      continue;
    }
    if (OfBlob(wand.blobs[k]).by_others) cost += kByOthersCost;
    const double noise = centre.noise_grey / centre.contrast_grey;
    const double residual = outline->residual * std::hypot(noise, kMeterNoise);
    const double misfit =
        Squared(std::max(0.0, residual / std::hypot(noise, kOutlineNoise) - 1) / kResidualSigma);
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

void WandVerifier::FitOutlines(const ImageView& image, VerifiedWand* wand) {
  OutlinedMarkers markers(wand->blobs.size());
  for (size_t k = 0; k < wand->blobs.size(); ++k) {
    if (!wand->whole[k] || !OutlineOf(image, wand->blobs[k])) continue;
    const Measured& measured = OfBlob(wand->blobs[k]);
    markers[k] = {&*measured.outline, &measured.pixels};
  }
  SetOutlinedCentres(markers, &fitter_, wand);
}

void WandVerifier::StartImage() {
  measured_count_ = 0;
  meter_.StartImage();
}

Verdict WandVerifier::Verify(const ImageView& image, absl::Span<const Blob> blobs,
                             const WandFinder& finder, absl::Span<const WandCandidate> candidates,
                             int tried, bool in_room, double* work) {
  chance_cost_ = kTriedCost * std::log(1 + tried / kFewTried);
  in_room_ = in_room;
  work_ = *work;
  out_of_work_ = false;
  size_t count = 0;
  measured_of_.assign(blobs.size(), -1);
  evaluated_.clear();
  double best = kHalfCost;
  for (const WandCandidate& candidate : candidates) {
    if (candidate.cost > best + kClearlyWorse) break;
    if (IsKnown(candidate, blobs)) {
      count += out_of_work_ ? 0 : 1;
      continue;
    }
    auto wand = EvaluateOne(image, blobs, finder, candidate);
    if (!out_of_work_) ++count;
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
    wand.confidence = ConfidenceOf(wand.cost);
  }
  Verdict verdict = Choose();
  verdict.measured = count;
  verdict.left_out = out_of_work_;
  *work = work_;
  return verdict;
}

}  // namespace rigcal::agent
