// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/pair_scores.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/solve/clocks/epipolar_score.h"

namespace rigcal::server {
namespace {

constexpr double kUnmatched = std::numeric_limits<double>::infinity();
constexpr double kCoarseStepS = 0.01;  // the solve needs about 10 ms
constexpr double kFineStepS = 0.001;
constexpr double kLeftAlonePeriods = 0.125;

}  // namespace

PairScores::PairScores(const TrackPaths& a, const TrackPaths& b, int min_matches)
    : a_(a), b_(b), min_matches_(std::max(kMinEpipolarMatches, min_matches)) {}

double PairScores::At(double offset_s) {
  const auto [entry, inserted] = known_.try_emplace(std::llround(offset_s * 1e6), kUnmatched);
  if (inserted) entry->second = EpipolarScorePx(a_, b_, offset_s, min_matches_);
  return entry->second;
}

double PairScores::Descend(double offset_s, double centre_s, double reach_s) {
  for (double step_s = kCoarseStepS; step_s >= kFineStepS; step_s *= 0.5) {
    for (const double direction_s : {step_s, -step_s}) {
      while (std::abs(offset_s + direction_s - centre_s) <= reach_s &&
             At(offset_s + direction_s) < At(offset_s)) {
        offset_s += direction_s;
      }
    }
  }
  return offset_s;
}

double OffsetToApply(double offset_s, const TrackPaths& a, const TrackPaths& b) {
  const double period_s = std::min(a.period_s, b.period_s);
  return std::abs(offset_s) <= kLeftAlonePeriods * period_s ? 0 : offset_s;
}

}  // namespace rigcal::server
