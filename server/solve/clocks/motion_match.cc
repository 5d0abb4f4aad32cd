// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/motion_match.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/statistics/robust_statistics.h"
#include "server/solve/clocks/epipolar_score.h"
#include "server/solve/clocks/pair_scores.h"

namespace rigcal::server {
namespace {

constexpr double kMinOverlapS = 8;   // of each marker
constexpr double kPeakWidthS = 0.3;  // offsets nearer to each other are of one valley
constexpr size_t kMostValleys = 5;   // that are looked at closely
constexpr double kWorthLooking = 3;  // times the deepest valley
constexpr double kMarginS = 1;       // of what is cut out around an overlap
constexpr double kConvincingMotionPx = 4;
constexpr double kConvincingMotionShare = 0.3;  // of the score of wrong offsets
// A second valley is another one only if it is worse by this factor, and this much.
constexpr double kDistinctFactor = 1.5;
constexpr double kDistinctPx = 0.2;

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

// Lags of the deepest valleys, deepest first.
std::vector<size_t> DeepestValleys(const LagScores& lags) {
  std::vector<size_t> order;
  for (size_t i = 0; i < lags.rms_px.size(); ++i) {
    if (std::isfinite(lags.rms_px[i])) order.push_back(i);
  }
  std::ranges::stable_sort(order, {}, [&lags](size_t i) { return lags.rms_px[i]; });
  std::vector<size_t> valleys;
  for (const size_t lag : order) {
    if (lags.rms_px[lag] > kWorthLooking * lags.rms_px[order.front()]) break;
    const bool is_new = std::ranges::none_of(valleys, [&](size_t other) {
      return std::abs(lags.OffsetS(lag) - lags.OffsetS(other)) < kPeakWidthS;
    });
    if (is_new) valleys.push_back(lag);
    if (valleys.size() == kMostValleys) break;
  }
  return valleys;
}

// The median score of other offsets at which about as much is in common: any matrix fits little
// motion well.
double UsualPx(const LagScores& lags, size_t lag) {
  std::vector<double> others;
  for (size_t i = 0; i < lags.rms_px.size(); ++i) {
    if (!std::isfinite(lags.rms_px[i])) continue;
    if (2 * lags.matches[i] < lags.matches[lag] || lags.matches[i] > 2 * lags.matches[lag])
      continue;
    if (std::abs(lags.OffsetS(i) - lags.OffsetS(lag)) < kPeakWidthS) continue;
    others.push_back(lags.rms_px[i]);
  }
  return others.empty() ? 0 : UpperMedian(&others);
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

}  // namespace

MotionMatch MatchMotion(const TrackPaths& a, const TrackPaths& b, const MotionSpectrum& spectrum_a,
                        const MotionSpectrum& spectrum_b) {
  MotionMatch match;
  const double min_matches =
      kMinOverlapS / spectrum_a.step_s * static_cast<double>(a.markers.size());
  const LagScores lags = ScoreAllLags(spectrum_a, spectrum_b, static_cast<int>(min_matches));
  const std::vector<size_t> valleys = DeepestValleys(lags);
  if (valleys.empty()) return match;
  for (const size_t lag : valleys) {
    const MotionPeak peak = LookClosely(a, b, spectrum_b, lags.OffsetS(lag));
    const bool convinces = peak.score_px < kConvincingMotionPx &&
                           peak.score_px < kConvincingMotionShare * UsualPx(lags, lag);
    if (convinces) match.peaks.push_back(peak);
  }
  std::ranges::stable_sort(match.peaks, {}, &MotionPeak::score_px);
  if (match.peaks.empty()) return match;
  const double distinct_px =
      std::max(kDistinctFactor * match.peaks[0].score_px, match.peaks[0].score_px + kDistinctPx);
  std::erase_if(match.peaks, [&](const MotionPeak& peak) { return peak.score_px > distinct_px; });
  match.verdict = match.peaks.size() > 1 ? MotionVerdict::kAmbiguous : MotionVerdict::kFound;
  return match;
}

}  // namespace rigcal::server
