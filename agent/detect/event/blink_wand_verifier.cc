// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_wand_verifier.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "agent/detect/event/wrapped_time.h"

namespace rigcal::agent {
namespace {

// Width of the rim in which a pixel is lit by chance, and what does not shrink with the size: lens,
// latency, noise beside the rim. Such that accuracy.event_detection sees errors of one sigma.
constexpr double kRimPx = 0.27;
constexpr double kFloorPx = 0.042;
// Of the way from the answer to the rise to that to the fall: their mean may be so far off.
constexpr double kMeanShare = 0.2;
// Of a centre without them: it lies ahead of the light's, and its time is not quite the light's.
constexpr double kUntimedPx = 0.3;
// By which a centre may be further from where a candidate has it: lenses are not known that well.
constexpr double kFitSlack = 1.7;
constexpr double kRadiusPx = 0.4, kRadiusShare = 0.06;
// In the image, of a wand whose markers are seen one after the other.
constexpr double kMotionPxPerUs = 600e-6;
constexpr double kHalfCost = 13;  // confidence 0.5
constexpr double kCostScale = 2.5;
constexpr double kMargin = 8;  // in cost, of a wand against another one
constexpr double kCertain = 0.999;

double Radius(const Blob& blob) { return std::sqrt(blob.area_px / std::numbers::pi); }

double CentreVariance(const Blob& blob) {
  return kRimPx / (4 * std::numbers::pi * Radius(blob)) + kFloorPx * kFloorPx;
}

}  // namespace

void BlinkWandVerifier::TakeBlobs(const std::vector<BlinkBlob>& blobs) {
  order_.resize(blobs.size());
  std::iota(order_.begin(), order_.end(), 0);
  std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) {
    return blobs[static_cast<size_t>(a)].area_px > blobs[static_cast<size_t>(b)].area_px;
  });
  blobs_.clear();
  times_us_.clear();
  frequencies_.clear();
  is_timed_.clear();
  rise_to_fall_px_.clear();
  for (const int index : order_) {
    const BlinkBlob& from = blobs[static_cast<size_t>(index)];
    // The seeds of one marker may fall apart; each part then finds all of it.
    const bool known = std::any_of(blobs_.begin(), blobs_.end(), [&](const Blob& blob) {
      return (blob.centre_px - from.centre_px).squaredNorm() * std::numbers::pi < blob.area_px;
    });
    if (known) continue;
    if (blobs_.size() == kMaxBlobs) break;
    blobs_.push_back(from);
    times_us_.push_back(from.time_us);
    frequencies_.push_back(from.frequency);
    is_timed_.push_back(from.is_timed);
    rise_to_fall_px_.push_back(from.rise_to_fall_px);
  }
}

bool BlinkWandVerifier::Refit(const WandCandidate& candidate, Evaluated* evaluated) const {
  evaluated->candidate = &candidate;
  if (candidate.blobs.size() == 1) return true;
  const auto time_us = [this](int blob) { return times_us_[static_cast<size_t>(blob)]; };
  const double any_us = time_us(candidate.blobs[0]);
  double mean_us = 0;
  for (const int index : candidate.blobs) {
    mean_us += SinceUs(any_us, time_us(index)) / static_cast<double>(candidate.blobs.size());
  }
  absl::InlinedVector<MarkerSight, 4> sights;
  for (const int index : candidate.blobs) {
    const Blob& blob = blobs_[static_cast<size_t>(index)];
    MarkerSight& sight = sights.emplace_back();
    if (!finder_.Sight(blob.centre_px, &sight)) return false;
    sight.radius_px = Radius(blob);
    sight.sigma_px = std::hypot(kFitSlack * std::sqrt(CentreVariance(blob)),
                                kMotionPxPerUs * (SinceUs(any_us, time_us(index)) - mean_us));
    sight.radius_sigma_px = kRadiusPx + kRadiusShare * sight.radius_px;
    if (blob.touches_border) {
      sight.sigma_px += 0.5 * sight.radius_px;
      sight.radius_sigma_px += 0.5 * sight.radius_px;
    }
  }
  return FitWand(sights, finder_.shares(), finder_.length_m(), finder_.fit_options(),
                 &evaluated->fit);
}

MarkerObservation BlinkWandVerifier::Observe(const Evaluated& wand, size_t k) const {
  const Blob& blob = blobs_[static_cast<size_t>(wand.candidate->blobs[k])];
  MarkerObservation marker;
  if (blob.touches_border) return marker;
  marker.visible = true;
  marker.centre_px = blob.centre_px;
  const auto index = static_cast<size_t>(wand.candidate->blobs[k]);
  const Eigen::Vector2d off_px = kMeanShare * rise_to_fall_px_[index];
  const double untimed_px = is_timed_[index] ? 0 : kUntimedPx;
  marker.covariance_px2 =
      (CentreVariance(blob) + untimed_px * untimed_px) * Eigen::Matrix2d::Identity() +
      off_px * off_px.transpose();
  finder_.ToSphereCentre(wand.fit, k, &marker);
  return marker;
}

BlinkWand BlinkWandVerifier::Verify(const std::vector<BlinkBlob>& blobs) {
  BlinkWand wand;
  TakeBlobs(blobs);
  wand.blob_count = static_cast<int>(blobs_.size());
  if (blobs_.empty()) return wand;
  wand.outcome = DetectionOutcome::kNoWand;
  evaluated_.clear();
  for (const WandCandidate& candidate : finder_.Find(blobs_, frequencies_)) {
    Evaluated evaluated;
    if (Refit(candidate, &evaluated)) evaluated_.push_back(evaluated);
  }
  std::stable_sort(evaluated_.begin(), evaluated_.end(),
                   [](const Evaluated& a, const Evaluated& b) { return a.fit.cost < b.fit.cost; });
  if (evaluated_.empty()) return wand;
  const Evaluated& best = evaluated_.front();
  wand.confidence = 1 / (1 + std::exp((best.fit.cost - kHalfCost) / kCostScale));
  if (wand.confidence < min_confidence_) return wand;
  double label_confidence = kCertain;
  for (size_t i = 1; i < evaluated_.size(); ++i) {
    const Evaluated& other = evaluated_[i];
    if (SameBlobs(best.candidate->blobs, other.candidate->blobs)) {
      const double certainty = 1 / (1 + std::exp(0.5 * (best.fit.cost - other.fit.cost)));
      label_confidence = std::min(label_confidence, std::max(0.5, certainty));
    } else if (other.fit.cost < best.fit.cost + kMargin) {
      wand.outcome = DetectionOutcome::kAmbiguous;
      return wand;
    }
  }
  if (best.candidate->blobs.size() == 1) label_confidence = 1;
  wand.outcome = DetectionOutcome::kWand;
  wand.is_timed = true;
  for (size_t k = 0; k < best.candidate->blobs.size(); ++k) {
    MarkerObservation& marker = wand.markers.emplace_back(Observe(best, k));
    marker.label_confidence = static_cast<float>(label_confidence);
    const auto blob = static_cast<size_t>(best.candidate->blobs[k]);
    wand.times_us.push_back(times_us_[blob]);
    wand.is_timed &= is_timed_[blob];
  }
  return wand;
}

}  // namespace rigcal::agent
