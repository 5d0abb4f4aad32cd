// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>

#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {

// Epipolar scores of a pair of tracks by the offset of the second, kept because searches overlap.
// The tracks must outlive it.
class PairScores {
 public:
  // Infinite are the scores of offsets with fewer than `min_matches` matches, or than a matrix with
  // eight degrees of freedom needs: it fits few matches at any offset.
  PairScores(const TrackPaths& a, const TrackPaths& b, int min_matches);

  double At(double offset_s);  // px, see EpipolarScorePx

  // The bottom of the valley in which an offset lies, at most `reach_s` from `centre_s`: downhill
  // by steps of 10 ms, then by ever smaller ones to about a millisecond.
  double Descend(double offset_s, double centre_s, double reach_s);

 private:
  const TrackPaths& a_;
  const TrackPaths& b_;
  const int min_matches_;
  std::map<int64_t, double> known_;  // by microseconds
};

// The offset to apply for one that was found: clocks that agree to an eighth of a period, half the
// width of an instant, are left exactly as they are.
double OffsetToApply(double offset_s, const TrackPaths& a, const TrackPaths& b);

// The share of the matches at one offset that others nearby must have.
inline constexpr double kMinMatchShare = 0.6;

}  // namespace rigcal::server
