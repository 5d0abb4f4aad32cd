// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/motion_match.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "common/statistics/robust_statistics.h"
#include "server/solve/clocks/epipolar_score.h"
#include "server/solve/clocks/pair_scores.h"

namespace rigcal::server {
namespace {

// Of each marker. One point alone says less at each moment than a wand.
constexpr double kMinOverlapS = 8;
constexpr double kMinPointOverlapS = 20;
constexpr double kPeakWidthS = 0.3;    // offsets nearer to each other are of one valley
constexpr size_t kMostValleys = 5;     // that are looked at closely
constexpr double kWorthLooking = 0.5;  // share of the best evidence
constexpr double kMarginS = 1;         // of what is cut out around an overlap
constexpr double kConvincingMotionPx = 2.5;
constexpr double kConvincingMotionShare = 0.1;  // of the score of wrong offsets
constexpr double kConvincingRmsShare = 0.25;    // likewise, of its root mean square
// Chance makes some offsets better than others; the right one stands out from all of them.
constexpr double kDistinctEvidence = 1.4;
// Far away and slow, even wrong offsets fit to some pixels, and noise is a larger share of that.
// Then the right one must stand out the more.
constexpr double kConvincingFarShare = 0.2, kConvincingFarRmsShare = 0.35;
constexpr double kDistinctFarEvidence = 2;
// What may count where other pairs of cameras say the same.
constexpr double kCandidateRmsShare = 0.6, kCandidateShare = 0.5;
constexpr double kCandidateEvidence = 1.2;
constexpr double kRivalS = 1;
constexpr double kRidgeShare = 0.5;  // of the score of wrong offsets
// Another valley is as good as the best one if its evidence is this share of the best, and its
// score is not worse by this factor, or this much.
constexpr double kAsGoodEvidence = 0.6;
constexpr double kDistinctFactor = 1.5;
constexpr double kDistinctPx = 0.2;
// Numbers of matches within this factor are compared with each other.
constexpr double kAlikeFactor = 1.4;

// The part of a track from one time to another.
TrackPaths Between(const TrackPaths& paths, double from_s, double to_s) {
  TrackPaths part = paths;
  for (RayPath& path : part.markers) {
    const auto first = std::ranges::lower_bound(path.time_s, from_s) - path.time_s.begin();
    const auto last = std::ranges::upper_bound(path.time_s, to_s) - path.time_s.begin();
    path.time_s = {path.time_s.begin() + first, path.time_s.begin() + last};
    path.ray = {path.ray.begin() + first, path.ray.begin() + last};
  }
  return part;
}

// The median score of lags with about as many matches, by lag: any matrix fits little motion well.
std::vector<double> UsualScores(const LagScores& lags) {
  const auto bin_of = [&lags](size_t lag) {
    return static_cast<size_t>(std::log(lags.matches[lag]) / std::log(kAlikeFactor));
  };
  std::vector<std::vector<double>> bins;
  for (size_t i = 0; i < lags.rms_px.size(); ++i) {
    if (!std::isfinite(lags.rms_px[i])) continue;
    if (bin_of(i) >= bins.size()) bins.resize(bin_of(i) + 1);
    bins[bin_of(i)].push_back(lags.rms_px[i]);
  }
  std::vector<double> medians;
  for (std::vector<double>& bin : bins) medians.push_back(bin.empty() ? 0 : UpperMedian(&bin));
  std::vector<double> usual(lags.rms_px.size(), 0);
  for (size_t i = 0; i < usual.size(); ++i) {
    if (std::isfinite(lags.rms_px[i])) usual[i] = medians[bin_of(i)];
  }
  return usual;
}

// How much an offset explains: the logarithm of the likelihood that normally distributed errors
// gain over those of wrong offsets.
double Evidence(int matches, double usual_px, double score_px) {
  constexpr double kLeastPx = 1e-3;
  return matches * std::log(std::max(usual_px, kLeastPx) / std::max(score_px, kLeastPx));
}

// By lag, of all matches, which no robust score leaves out: half of a motion is often fitted well.
std::vector<double> EvidenceByLag(const LagScores& lags, const std::vector<double>& usual_px) {
  std::vector<double> evidence(lags.rms_px.size(), 0);
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (!std::isfinite(lags.rms_px[i])) continue;
    evidence[i] = Evidence(lags.matches[i], usual_px[i], lags.rms_px[i]);
  }
  return evidence;
}

// Lags of the valleys with most evidence, the best first.
std::vector<size_t> BestValleys(const LagScores& lags, const std::vector<double>& evidence) {
  std::vector<size_t> order;
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (evidence[i] > 0) order.push_back(i);
  }
  std::ranges::stable_sort(order, std::greater(), [&](size_t i) { return evidence[i]; });
  std::vector<size_t> valleys;
  for (const size_t lag : order) {
    if (evidence[lag] < kWorthLooking * evidence[order.front()]) break;
    const bool is_new = std::ranges::none_of(valleys, [&](size_t other) {
      return std::abs(lags.OffsetS(lag) - lags.OffsetS(other)) < kPeakWidthS;
    });
    if (is_new) valleys.push_back(lag);
    if (valleys.size() == kMostValleys) break;
  }
  return valleys;
}

// Near to each other, with nothing between them that fits badly: a slow motion has wide valleys
// with several bottoms. A motion that repeats itself has none between two of its periods.
bool AreOneValley(const LagScores& lags, const std::vector<double>& usual_px, size_t a, size_t b) {
  if (std::abs(lags.OffsetS(a) - lags.OffsetS(b)) >= kRivalS) return false;
  for (size_t lag = std::min(a, b); lag <= std::max(a, b); ++lag) {
    if (!(lags.rms_px[lag] < kRidgeShare * usual_px[lag])) return false;
  }
  return true;
}

// The most evidence for any other offset than about that of `lag`.
double RivalEvidence(const LagScores& lags, const std::vector<double>& evidence, size_t lag) {
  double most = 0;
  for (size_t i = 0; i < evidence.size(); ++i) {
    if (std::abs(lags.OffsetS(i) - lags.OffsetS(lag)) > kRivalS) most = std::max(most, evidence[i]);
  }
  return most;
}

MotionPeak LookClosely(const TrackPaths& a, const TrackPaths& b, const MotionSpectrum& spectrum_b,
                       double offset_s) {
  const double first_s = spectrum_b.first_time_s + offset_s;
  const double last_s = first_s + spectrum_b.step_s * spectrum_b.sample_count;
  const TrackPaths part = Between(a, first_s - kMarginS, last_s + kMarginS);
  const int matches = CountMatches(part, b, offset_s);
  PairScores scores(part, b, static_cast<int>(kMinMatchShare * matches));
  const double bottom_s = scores.Descend(offset_s, offset_s, kPeakWidthS);
  return {bottom_s, scores.At(bottom_s)};
}

// The best valley, if it is better than others by something.
MotionMatch CandidateOf(const TrackPaths& a, const TrackPaths& b, const MotionSpectrum& spectrum_b,
                        const LagScores& lags, const std::vector<double>& usual_px,
                        const std::vector<double>& by_lag) {
  const std::vector<size_t> valleys = BestValleys(lags, by_lag);
  if (valleys.empty()) return {};
  const size_t lag = valleys.front();
  if (lags.rms_px[lag] > kCandidateRmsShare * usual_px[lag] ||
      by_lag[lag] < kCandidateEvidence * RivalEvidence(lags, by_lag, lag)) {
    return {};
  }
  const MotionPeak peak = LookClosely(a, b, spectrum_b, lags.OffsetS(lag));
  if (peak.score_px > kConvincingMotionPx || peak.score_px > kCandidateShare * usual_px[lag]) {
    return {};
  }
  return {MotionVerdict::kCandidate, {peak}};
}

}  // namespace

MotionMatch MatchMotion(const TrackPaths& a, const TrackPaths& b, const MotionSpectrum& spectrum_a,
                        const MotionSpectrum& spectrum_b) {
  MotionMatch match;
  // Of a body with many points only some have a path (PathsOf).
  const auto markers = static_cast<double>(std::ranges::count_if(
      a.markers, [](const RayPath& path) { return !path.time_s.empty(); }));
  const double overlap_s = a.markers.size() == 1 ? kMinPointOverlapS : kMinOverlapS * markers;
  const LagScores lags =
      ScoreAllLags(spectrum_a, spectrum_b, static_cast<int>(overlap_s / spectrum_a.step_s));
  const std::vector<double> usual_px = UsualScores(lags);
  const std::vector<double> by_lag = EvidenceByLag(lags, usual_px);
  struct Candidate {
    MotionPeak peak;
    size_t lag;
    double evidence;
  };
  std::vector<Candidate> candidates;
  for (const size_t lag : BestValleys(lags, by_lag)) {
    if (lags.rms_px[lag] > kConvincingFarRmsShare * usual_px[lag]) continue;
    const MotionPeak peak = LookClosely(a, b, spectrum_b, lags.OffsetS(lag));
    if (peak.score_px > kConvincingMotionPx ||
        peak.score_px > kConvincingFarShare * usual_px[lag]) {
      continue;
    }
    candidates.push_back({peak, lag, Evidence(lags.matches[lag], usual_px[lag], peak.score_px)});
  }
  if (candidates.empty()) return CandidateOf(a, b, spectrum_b, lags, usual_px, by_lag);
  std::ranges::stable_sort(candidates, std::greater(), &Candidate::evidence);
  const Candidate& best = candidates.front();
  const double as_good_px =
      std::max(kDistinctFactor * best.peak.score_px, best.peak.score_px + kDistinctPx);
  std::vector<size_t> accepted;
  for (const Candidate& candidate : candidates) {
    const bool is_new = std::ranges::none_of(
        accepted, [&](size_t other) { return AreOneValley(lags, usual_px, other, candidate.lag); });
    if (is_new && candidate.evidence >= kAsGoodEvidence * best.evidence &&
        candidate.peak.score_px <= as_good_px) {
      match.peaks.push_back(candidate.peak);
      accepted.push_back(candidate.lag);
    }
  }
  match.verdict = match.peaks.size() > 1 ? MotionVerdict::kAmbiguous : MotionVerdict::kFound;
  const bool is_far = lags.rms_px[best.lag] > kConvincingRmsShare * usual_px[best.lag] ||
                      best.peak.score_px > kConvincingMotionShare * usual_px[best.lag];
  const double distinct = is_far ? kDistinctFarEvidence : kDistinctEvidence;
  const bool stands_out = by_lag[best.lag] >= distinct * RivalEvidence(lags, by_lag, best.lag);
  if (!stands_out && (is_far || match.verdict == MotionVerdict::kFound)) {
    return CandidateOf(a, b, spectrum_b, lags, usual_px, by_lag);
  }
  return match;
}

}  // namespace rigcal::server
