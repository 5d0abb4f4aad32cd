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
// Of a centre by one switch (BlinkBlob::ahead): by how much, and how well that is known. Half of it
// is taken at this speed, whose direction is hardly known.
constexpr double kOneSwitchPx = 0.06, kOneSwitchLeftPx = 0.1, kOneSwitchPxPerUs = 10e-6;
// Of a marker's pixels, those that answer anyway. Where fewer do (BlinkBlob::answered_share), the
// others are missing by chance, which moves the mean of the rest by a variance of (1 - share) / (4
// pi share) square pixels, whatever the size; by neighbours that are filled in or left out, more.
// Which of a pixel's events are missing moves the time by about that share of a period.
constexpr double kUsualShare = 0.96, kMissingFactor = 2, kMissingTimeFactor = 2;
constexpr double kMissLeastShare = 0.05;  // fewer cannot form a blob
// Of the depth to which the pixels of two markers overlap, and beyond which they are apart: what is
// between them may have been given to the wrong one.
constexpr double kTouchShare = 0.2, kTouchPx = 0.5;
// By which a centre may be further from where a candidate has it: lenses are not known that well.
constexpr double kFitSlack = 1.7;
constexpr double kRadiusPx = 0.4, kRadiusShare = 0.06;
// In the image, of a wand whose markers are seen one after the other.
constexpr double kMotionPxPerUs = 600e-6;
constexpr double kHalfCost = 13;  // confidence 0.5
constexpr double kCostScale = 2.5;
constexpr double kMargin = 8;  // in cost, of a wand against another one
constexpr double kCertain = 0.999;
constexpr double kAmbiguousUs = 100'000;  // another wand that was seen is still there
// A lamp may look like one for a moment of each of its periods.
constexpr double kLampUs = 3000;
// Of a wand that is followed: by which a marker's radius may differ from the last one, how many
// times its gate another marker must be away, the least size of what may be another wand's marker
// in terms of the largest, and how sure its labels must be.
constexpr double kFollowedRadiusPx = 0.4, kFollowedRadiusShare = 0.08;
constexpr double kApartGates = 2, kOtherShare = 0.3, kPieceRadii = 1.5, kFollowedCertainty = 0.9;
// Of a wand that comes into the image: its labels.
constexpr float kEnteringCertainty = 0.95f;

double Radius(const Blob& blob) { return std::sqrt(blob.area_px / std::numbers::pi); }

double CentreVariance(const Blob& blob) {
  return kRimPx / (4 * std::numbers::pi * Radius(blob)) + kFloorPx * kFloorPx;
}

// What pixels that did not answer add.
Eigen::Matrix2d CovarianceOfMissing(const BlinkBlob& blob,
                                    const std::optional<Eigen::Vector2d>& px_per_us) {
  const double missing = 1 - blob.answered_share / kUsualShare;
  if (missing <= 0) return Eigen::Matrix2d::Zero();
  const double share = std::max(kMissLeastShare, 1 - missing);
  const double variance = kMissingFactor * missing / (share * 4 * std::numbers::pi);
  const double late_us = kMissingTimeFactor * missing * blob.period_us;
  if (!px_per_us) {
    return (variance + std::pow(late_us * kMotionPxPerUs, 2)) * Eigen::Matrix2d::Identity();
  }
  const Eigen::Vector2d late_px = late_us * *px_per_us;
  return variance * Eigen::Matrix2d::Identity() + late_px * late_px.transpose();
}

}  // namespace

void BlinkWandVerifier::TakeBlobs(const std::vector<BlinkBlob>& blobs) {
  order_.resize(blobs.size());
  std::iota(order_.begin(), order_.end(), 0);
  std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) {
    return blobs[static_cast<size_t>(a)].area_px > blobs[static_cast<size_t>(b)].area_px;
  });
  blobs_.clear();
  seen_.clear();
  frequencies_.clear();
  for (const int index : order_) {
    const BlinkBlob& from = blobs[static_cast<size_t>(index)];
    // The seeds of one marker may fall apart; each part then finds all of it.
    const bool known = std::any_of(blobs_.begin(), blobs_.end(), [&](const Blob& blob) {
      return (blob.centre_px - from.centre_px).squaredNorm() * std::numbers::pi < blob.area_px;
    });
    if (known) continue;
    if (blobs_.size() == kMaxBlobs) break;
    blobs_.push_back(from);
    seen_.push_back(from);
    frequencies_.push_back(from.frequency);
  }
}

MarkerSight BlinkWandVerifier::SightOf(int index) const {
  const Blob& blob = blobs_[static_cast<size_t>(index)];
  MarkerSight sight;
  if (!finder_.Sight(blob.centre_px, &sight)) sight.scale_px = 0;
  sight.radius_px = Radius(blob);
  sight.sigma_px = kFitSlack * std::sqrt(CentreVariance(blob));
  sight.radius_sigma_px = kRadiusPx + kRadiusShare * sight.radius_px;
  return sight;
}

bool BlinkWandVerifier::Refit(const WandCandidate& candidate, Evaluated* evaluated) const {
  evaluated->candidate = &candidate;
  if (candidate.blobs.size() == 1) return true;
  const auto time_us = [this](int blob) { return seen_[static_cast<size_t>(blob)].time_us; };
  const double any_us = time_us(candidate.blobs[0]);
  double mean_us = 0;
  for (const int index : candidate.blobs) {
    mean_us += SinceUs(any_us, time_us(index)) / static_cast<double>(candidate.blobs.size());
  }
  absl::InlinedVector<MarkerSight, 4> sights;
  for (const int index : candidate.blobs) {
    MarkerSight& sight = sights.emplace_back(SightOf(index));
    if (sight.scale_px <= 0) return false;
    sight.sigma_px =
        std::hypot(sight.sigma_px, kMotionPxPerUs * (SinceUs(any_us, time_us(index)) - mean_us));
    const Blob& blob = blobs_[static_cast<size_t>(index)];
    if (blob.touches_border) {
      sight.sigma_px += 0.5 * sight.radius_px;
      sight.radius_sigma_px += 0.5 * sight.radius_px;
    }
  }
  return FitWand(sights, finder_.shares(), finder_.length_m(), finder_.fit_options(),
                 &evaluated->fit);
}

void BlinkWandVerifier::TakeLight(int index, BlinkWand* wand) const {
  const BlinkBlob& blob = seen_[static_cast<size_t>(index)];
  wand->is_timed &= blob.is_timed;
  wand->is_beside_gap |= blob.beside_gap;
  if (!blob.touches_border) {
    wand->answered_share = std::min(wand->answered_share, blob.answered_share);
  }
}

MarkerObservation BlinkWandVerifier::Observe(const WandImageFit& fit, size_t k,
                                             int blob_index) const {
  MarkerObservation marker;
  if (blob_index < 0) return marker;
  const BlinkBlob& blob = seen_[static_cast<size_t>(blob_index)];
  if (blob.touches_border) return marker;
  marker.visible = true;
  marker.centre_px = blob.centre_px;
  const Eigen::Vector2d off_px = kMeanShare * blob.rise_to_fall_px;
  double untimed_px = blob.is_timed ? 0 : kUntimedPx;
  if (const auto px_per_us = track_.Velocity(k); px_per_us && blob.ahead != 0) {
    const double share = kOneSwitchPx / (px_per_us->norm() + kOneSwitchPxPerUs);
    marker.centre_px -= blob.ahead * share * *px_per_us;
    untimed_px = kOneSwitchLeftPx;
  }
  marker.covariance_px2 =
      (CentreVariance(blob) + untimed_px * untimed_px) * Eigen::Matrix2d::Identity() +
      off_px * off_px.transpose();
  marker.covariance_px2 += CovarianceOfMissing(blob, track_.Velocity(k));
  for (const Blob& other : blobs_) {
    const Eigen::Vector2d away_px = other.centre_px - blob.centre_px;
    const double apart_px = away_px.norm();
    const double overlap_px = Radius(blob) + Radius(other) + kTouchPx - apart_px;
    if (apart_px == 0 || overlap_px <= 0) continue;
    const Eigen::Vector2d wrong_px = kTouchShare * overlap_px / apart_px * away_px;
    marker.covariance_px2 += wrong_px * wrong_px.transpose();
  }
  finder_.ToSphereCentre(fit, k, &marker);
  return marker;
}

BlinkWand BlinkWandVerifier::Verify(const std::vector<BlinkBlob>& blobs) {
  TakeBlobs(blobs);
  if (!blobs_.empty()) {
    const double now_us = seen_.front().time_us;
    track_.ForgetBefore(now_us);
    if (ambiguous_us_ && SinceUs(*ambiguous_us_, now_us) > kAmbiguousUs) ambiguous_us_.reset();
  }
  BlinkWand wand = Choose();
  if (wand.outcome == DetectionOutcome::kNoWand && !track_.empty()) {
    if (BlinkWand followed = Follow(); followed.outcome == DetectionOutcome::kWand) {
      wand = std::move(followed);
    }
  } else if (wand.outcome == DetectionOutcome::kNoWand && !ambiguous_us_) {
    wand = Enter();
  }
  UpdateTrack(wand);
  if (wand.outcome == DetectionOutcome::kWand) {
    const int middle = wand.blobs[wand.blobs.size() / 2];
    const BlinkBlob* const blob = middle >= 0 ? &seen_[static_cast<size_t>(middle)] : nullptr;
    if (blob != nullptr && blob->is_timed) {
      wand.lit_share = 2 * SinceUs(blob->burst_us, blob->time_us) / blob->period_us;
    }
  }
  return wand;
}

BlinkWand BlinkWandVerifier::Choose() {
  BlinkWand wand;
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
    } else if (other.fit.cost < best.fit.cost + kMargin &&
               !DifferInCutOnly(best.candidate->blobs, other.candidate->blobs)) {
      wand.outcome = DetectionOutcome::kAmbiguous;
      return wand;
    }
  }
  if (best.candidate->blobs.size() == 1) label_confidence = 1;
  if (best.candidate->blobs.size() > 2 && IsBesideAnother(best.candidate->blobs)) {
    wand.outcome = DetectionOutcome::kAmbiguous;
    return wand;
  }
  wand.outcome = DetectionOutcome::kWand;
  wand.is_timed = true;
  int visible = 0;
  for (size_t k = 0; k < best.candidate->blobs.size(); ++k) {
    const int blob = best.candidate->blobs[k];
    MarkerObservation& marker = wand.markers.emplace_back(Observe(best.fit, k, blob));
    marker.label_confidence = static_cast<float>(label_confidence);
    wand.blobs.push_back(blob);
    wand.times_us.push_back(seen_[static_cast<size_t>(blob)].time_us);
    TakeLight(blob, &wand);
    visible += marker.visible ? 1 : 0;
  }
  // All but one cut by the border: whose that one is cannot be checked.
  if (visible < std::min<int>(2, static_cast<int>(wand.blobs.size()))) {
    wand.outcome = DetectionOutcome::kNoWand;
    wand.markers.clear();
    wand.times_us.clear();
    wand.blobs.clear();
  }
  return wand;
}

// A sphere that the border cuts may be in pieces.
bool BlinkWandVerifier::DifferInCutOnly(absl::Span<const int> a, absl::Span<const int> b) const {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [this](int one, int other) {
    return one == other || (blobs_[static_cast<size_t>(one)].touches_border &&
                            blobs_[static_cast<size_t>(other)].touches_border);
  });
}

bool BlinkWandVerifier::IsBesideAnother(absl::Span<const int> wand) {
  // Of another wand some markers may have grown together with this one's: of one that was seen just
  // now, all but one.
  const int most_others = ambiguous_us_ ? 0 : 1;
  const double now_us = seen_.front().time_us;
  if (OthersThan(wand) > most_others) {
    return !alone_us_ || SinceUs(*alone_us_, now_us) > kLampUs;
  }
  alone_us_ = now_us;
  return false;
}

int BlinkWandVerifier::OthersThan(absl::Span<const int> wand) const {
  double largest_px = 0;
  for (const int blob : wand) {
    if (blob >= 0) largest_px = std::max(largest_px, Radius(blobs_[static_cast<size_t>(blob)]));
  }
  int others = 0;
  for (size_t i = 0; i < blobs_.size(); ++i) {
    const Blob& other = blobs_[i];
    if (Radius(other) <= kOtherShare * largest_px) continue;
    // A piece of a marker that is there already is no other one.
    const bool is_of_wand = std::any_of(wand.begin(), wand.end(), [&](int blob) {
      if (blob < 0) return false;
      const Blob& marker = blobs_[static_cast<size_t>(blob)];
      return (marker.centre_px - other.centre_px).norm() < kPieceRadii * Radius(marker);
    });
    others += is_of_wand ? 0 : 1;
  }
  return others;
}

int BlinkWandVerifier::FindFollowed(size_t marker) const {
  int found = -1;
  for (size_t i = 0; i < blobs_.size(); ++i) {
    const BlinkWandTrack::Prediction expected = track_.Predict(marker, seen_[i].time_us);
    const bool is_near = (blobs_[i].centre_px - expected.centre_px).norm() < expected.gate_px;
    if (!is_near || frequencies_[i] != expected.frequency) continue;
    if (found >= 0) return -1;
    found = static_cast<int>(i);
  }
  if (found < 0) return -1;
  const auto index = static_cast<size_t>(found);
  // Part of it is hidden: its centre is not the marker's.
  const double radius_px = track_.Predict(marker, seen_[index].time_us).radius_px;
  const bool is_whole = std::abs(Radius(blobs_[index]) - radius_px) <
                        kFollowedRadiusPx + kFollowedRadiusShare * radius_px;
  if (!is_whole || blobs_[index].touches_border) return -1;
  for (size_t other = 0; other < finder_.shares().size(); ++other) {
    if (other == marker) continue;
    const BlinkWandTrack::Prediction expected = track_.Predict(other, seen_[index].time_us);
    const double away_px = (blobs_[index].centre_px - expected.centre_px).norm();
    if (away_px < kApartGates * expected.gate_px) return -1;
  }
  return found;
}

BlinkWand BlinkWandVerifier::Follow() const {
  BlinkWand wand;
  wand.blob_count = static_cast<int>(blobs_.size());
  wand.outcome = DetectionOutcome::kNoWand;
  const size_t count = finder_.shares().size();
  if (count < 3) return wand;
  int seen = 0;
  double time_us = 0;
  for (size_t k = 0; k < count; ++k) {
    const int blob = FindFollowed(k);
    wand.blobs.push_back(blob);
    if (blob < 0) continue;
    const double marker_us = seen_[static_cast<size_t>(blob)].time_us;
    if (seen == 0) time_us = marker_us;
    ++seen;
  }
  if (seen < 2) return wand;
  const int others = OthersThan(wand.blobs);
  if (others > static_cast<int>(count) - seen) return wand;
  absl::InlinedVector<MarkerSight, 4> sights;
  for (size_t k = 0; k < count; ++k) {
    if (wand.blobs[k] >= 0) {
      sights.push_back(SightOf(wand.blobs[k]));
      if (sights.back().scale_px <= 0) return wand;
      continue;
    }
    const BlinkWandTrack::Prediction expected = track_.Predict(k, time_us);
    MarkerSight& sight = sights.emplace_back();
    if (!finder_.Sight(expected.centre_px, &sight)) return wand;
    sight.sigma_px = expected.gate_px + expected.radius_px;
    sight.radius_px = sight.radius_sigma_px = expected.radius_px;
  }
  WandImageFit fit;
  if (!FitWand(sights, finder_.shares(), finder_.length_m(), finder_.fit_options(), &fit)) {
    return wand;
  }
  wand.confidence = 1 / (1 + std::exp((fit.cost - kHalfCost) / kCostScale));
  if (wand.confidence < min_confidence_) return wand;
  wand.outcome = DetectionOutcome::kWand;
  wand.is_timed = true;
  for (size_t k = 0; k < count; ++k) {
    const int blob = wand.blobs[k];
    MarkerObservation& marker = wand.markers.emplace_back(Observe(fit, k, blob));
    marker.label_confidence = static_cast<float>(track_.label_confidence());
    wand.times_us.push_back(blob < 0 ? time_us : seen_[static_cast<size_t>(blob)].time_us);
    if (blob >= 0) TakeLight(blob, &wand);
  }
  return wand;
}

BlinkWand BlinkWandVerifier::Enter() const {
  BlinkWand wand;
  wand.blob_count = static_cast<int>(blobs_.size());
  wand.outcome = DetectionOutcome::kNoWand;
  absl::InlinedVector<int, 3> wholes, cuts;  // the largest come first
  for (size_t i = 0; i < blobs_.size(); ++i) {
    if (Radius(blobs_[i]) <= kOtherShare * Radius(blobs_[0])) break;
    (blobs_[i].touches_border ? cuts : wholes).push_back(static_cast<int>(i));
    if (wholes.size() > 2 || cuts.size() > 1) return wand;
  }
  if (wholes.size() != 2) return wand;
  std::array<SeenMarker, 2> seen;
  for (size_t i = 0; i < seen.size(); ++i) {
    const auto blob = static_cast<size_t>(wholes[i]);
    seen[i] = {SightOf(wholes[i]), blobs_[blob].centre_px, frequencies_[blob]};
    if (seen[i].sight.scale_px <= 0) return wand;
  }
  const std::optional<EnteringPair> pair =
      FindEnteringPair(finder_, geometry_, marker_kinds_, seen);
  if (!pair) return wand;
  for (const int cut : cuts) {
    const Eigen::Vector2d& at_px = blobs_[static_cast<size_t>(cut)].centre_px;
    const double reach_px = kApartGates * pair->other_radius_px;
    if (!pair->is_in_lens || (pair->other_px - at_px).norm() > reach_px) return wand;
  }
  wand.confidence = 1 / (1 + std::exp((pair->fit.cost - kHalfCost) / kCostScale));
  if (wand.confidence < min_confidence_) return wand;
  wand.outcome = DetectionOutcome::kWand;
  wand.is_timed = true;
  wand.blobs.assign(3, -1);
  for (size_t i = 0; i < seen.size(); ++i) {
    wand.blobs[static_cast<size_t>(pair->markers[i])] = wholes[i];
    TakeLight(wholes[i], &wand);
  }
  for (size_t k = 0; k < wand.blobs.size(); ++k) {
    MarkerObservation& marker = wand.markers.emplace_back(Observe(pair->fit, k, wand.blobs[k]));
    marker.label_confidence = kEnteringCertainty;
    const int timed = wand.blobs[k] < 0 ? wholes[0] : wand.blobs[k];
    wand.times_us.push_back(seen_[static_cast<size_t>(timed)].time_us);
  }
  return wand;
}

void BlinkWandVerifier::UpdateTrack(const BlinkWand& wand) {
  if (wand.outcome == DetectionOutcome::kAmbiguous) {
    track_.Forget();
    ambiguous_us_ = seen_.front().time_us;
  }
  if (wand.outcome != DetectionOutcome::kWand || wand.markers.size() < 3) return;
  std::vector<BlinkWandTrack::Sighting> sightings;
  bool is_certain = true;
  for (size_t k = 0; k < wand.markers.size(); ++k) {
    BlinkWandTrack::Sighting& sighting = sightings.emplace_back();
    is_certain &= wand.markers[k].label_confidence > kFollowedCertainty;
    if (wand.blobs[k] < 0) continue;
    const auto blob = static_cast<size_t>(wand.blobs[k]);
    sighting = {.seen = true,
                .centre_px = blobs_[blob].centre_px,
                .radius_px = Radius(blobs_[blob]),
                .time_us = seen_[blob].time_us,
                .frequency = frequencies_[blob]};
  }
  if (!is_certain) return track_.Forget();
  track_.Add(sightings, wand.markers.front().label_confidence);
}

}  // namespace rigcal::agent
