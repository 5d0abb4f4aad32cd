// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/motion_period.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "server/solve/clocks/motion_spectrum.h"

namespace rigcal::server {
namespace {

constexpr double kPeriodStepS = 0.01;
// A lag tells something with so much of all that was seen in common.
constexpr double kCommonShare = 0.5;
// Of the median distance: so far a marker must have gone, and so near it must come again.
constexpr double kGoneShare = 0.5;
constexpr double kBackShare = 0.05;
// A wand that hardly moves is always near.
constexpr double kMinMotionPx = 20;

}  // namespace

std::optional<double> FindMotionPeriod(const TrackPaths& paths) {
  const std::optional<double> step_s = GridStepS(SpanS(paths), kPeriodStepS);
  const int samples = step_s ? GridSamples(paths, *step_s) : 0;
  if (samples < 2) return std::nullopt;
  const MotionSpectrum spectrum = SpectrumOf(paths, *step_s, FftSizeFor(2 * samples));
  LagScores lags = DistanceFromItself(spectrum, 1);
  const double seen = lags.matches.front();
  std::vector<double> known;
  for (size_t i = 0; i < lags.rms_px.size(); ++i) {
    if (lags.matches[i] < kCommonShare * seen) lags.rms_px[i] = INFINITY;
    if (std::isfinite(lags.rms_px[i])) known.push_back(lags.rms_px[i]);
  }
  if (known.empty()) return std::nullopt;
  const double usual_px = UpperMedian(&known);
  if (usual_px < kMinMotionPx) return std::nullopt;
  const auto gone = std::ranges::find_if(lags.rms_px, [usual_px](double distance_px) {
    return std::isfinite(distance_px) && distance_px > kGoneShare * usual_px;
  });
  const auto nearest = std::min_element(gone, lags.rms_px.end());
  if (nearest == lags.rms_px.end() || *nearest > kBackShare * usual_px) return std::nullopt;
  // The first time that it is nearly as near, at the bottom of that valley.
  auto back = std::find_if(gone, lags.rms_px.end(), [usual_px](double distance_px) {
    return distance_px <= kBackShare * usual_px;
  });
  while (back + 1 != lags.rms_px.end() && *(back + 1) < *back) ++back;
  return lags.OffsetS(static_cast<size_t>(back - lags.rms_px.begin()));
}

}  // namespace rigcal::server
